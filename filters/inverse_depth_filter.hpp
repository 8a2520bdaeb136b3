#pragma once

#include <optional>

#include "camera/rig.hpp"
#include "geometry/inverse_depth.hpp"
#include "geometry/se3.hpp"

namespace twofold {

/// Information filter of one anchored inverse depth point given known camera poses  (thesis 3.4.4,
/// eq. 3.36, 3.37).
///
/// psi = (x/z, y/z, 1/z) in the anchor frame [-, -, 1/m]. A fresh monocular point has no depth information at
/// all, so any depth start value serves.
struct InverseDepthFilter {
  Vector3 psi{0, 0, 1};
  Matrix3 information = Matrix3::Zero();

  /// Left-image measurement only: Lambda = diag(f^2 / s^2, f^2 / s^2, 0)  (eq. 4.26).
  [[nodiscard]] static InverseDepthFilter from_mono(const PinholeCamera& camera, const Vector2& uv,
                                                    double sigma_px, double start_inverse_depth = 1.0);
  /// Stereo measurement: eq. 4.23 and Lambda = J^T J / s^2, J = d z_s / d psi (what eq. 4.24 means: the
  /// printed matrix is J's inverse).
  [[nodiscard]] static InverseDepthFilter from_stereo(const Rig& rig, const StereoPixel& z, double sigma_px);

  /// Folds in one measurement from a camera at T_c_a (anchor to camera), by Levenberg-Marquardt on eq. 3.36,
  /// then adds its information (3.37). z.z() NaN: left image only. False, and unchanged, when the point
  /// cannot be brought in front of the camera.
  bool update(const Rig& rig, const SE3& T_c_a, const StereoPixel& z, double sigma_px, int iterations = 10);

  /// Standard deviation of the inverse depth given everything seen; infinity while it is unknown.
  [[nodiscard]] double inverse_depth_sigma() const;
};

/// Projection of an anchored point and its derivatives, shared by the filters.
struct InverseDepthProjection {
  StereoPixel z_hat;
  Matrix36 J_camera;  ///< by a left perturbation of T_c_w
  Matrix36 J_anchor;  ///< by a left perturbation of T_a_w
  Matrix3 J_psi;
};

/// None when the point is behind the camera. An inverse depth of zero or less, a point at infinity or, by the
/// noise of a ray without parallax, beyond it, is as good as any other: the error goes on smoothly there.
[[nodiscard]] std::optional<InverseDepthProjection> project_inverse_depth(const Rig& rig, const SE3& T_c_a,
                                                                          const Vector3& psi);

}  // namespace twofold
