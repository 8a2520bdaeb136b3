#pragma once

#include <opencv2/core/mat.hpp>
#include <optional>
#include <string>

#include "camera/pinhole.hpp"
#include "geometry/se3.hpp"
#include "imaging/image_pyramid.hpp"

namespace twofold {

/// Homography by which a plane maps pixels of a reference view to another view of the same camera model,
///   H_v_r ~ K (R_v_r + t_v_r n_r^T / d_r) K^-1,   for points with n_r^T x_r = d_r.
///
/// @param x_r  a point of the plane in the reference frame [m]
/// @param n_r  the plane's normal there; SWF 4.1.2 takes the optical axis, (0, 0, 1)
/// @return nothing when the plane goes through the reference camera's centre.
[[nodiscard]] std::optional<Matrix3> plane_homography(const PinholeCamera& camera, const SE3& T_v_r,
                                                      const Vector3& x_r, const Vector3& n_r);

/// Pixel a homography maps uv to; its third homogeneous coordinate must not be zero.
[[nodiscard]] inline Vector2 map_pixel(const Matrix3& H, const Vector2& uv) {
  const Vector3 p = H * uv.homogeneous();
  return p.head<2>() / p.z();
}
/// d map_pixel / d uv.
[[nodiscard]] Eigen::Matrix2d map_pixel_jacobian(const Matrix3& H, const Vector2& uv);

/// The surroundings of a feature in the frame it was first seen in, and their gradients.
struct SurfacePatch {
  static constexpr int kHalf = 6;
  static constexpr int kSize = 2 * kHalf + 1;
  static constexpr int kArea = kSize * kSize;

  Vector2 uv{0, 0};  ///< centre, level-0 pixel of the reference view
  alignas(32) float value[kArea];
  alignas(32) float gradient_u[kArea];  ///< central differences [grey/px]
  alignas(32) float gradient_v[kArea];
};

/// Patch around a (sub-)pixel, bilinear; false when it reaches over the border.
[[nodiscard]] bool cut_surface_patch(const cv::Mat& image, const Vector2& uv, SurfacePatch& patch);

struct SurfaceAlignment {
  Vector2 uv;     ///< of the patch's centre in the view, level 0 [px]
  float rms = 0;  ///< of the remaining differences, gain and offset removed [grey]
};

struct SurfaceAlignmentOptions {
  int max_iterations = 15;    ///< >= 1
  double settled_px = 0.003;  ///< stop when a step is shorter [level px] > 0
  double max_move_px = 4;     ///< farther from the predicted place is another feature [level px] > 0
  bool along_row = false;     ///< move along the row only: right images of a rectified pair

  /// Empty when valid; otherwise names the field, the rule and the value.
  [[nodiscard]] std::string invalid_reason() const;
};

/// Lucas-Kanade over a translation, gain and offset, between a patch and a view warped back to the patch's
/// frame by H_v_r  (SWF 4.1.2). The view is read at the pyramid level where its pixels are about as large as
/// the patch's, bilinear; the patch's gradients serve for all iterations (Baker and Matthews 2004).
///
/// @return nothing when the patch leaves the view, is turned away, is scaled by more than 4, or does not
/// settle near the place H_v_r predicts.
[[nodiscard]] std::optional<SurfaceAlignment> align_surface_patch(const SurfacePatch& patch,
                                                                  const Matrix3& H_v_r,
                                                                  const ImagePyramid& view,
                                                                  const SurfaceAlignmentOptions& options);

}  // namespace twofold
