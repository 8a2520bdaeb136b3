#pragma once

#include <cstdint>
#include <opencv2/core/mat.hpp>
#include <optional>
#include <span>

#include "camera/pinhole.hpp"
#include "geometry/se3.hpp"
#include "imaging/point_appearance.hpp"

namespace twofold {

/// 8x8 template with its gradients, as it is expected to look in a view.
///
/// The corner is at row and column kCentre: entry (r, c) is at (c - kCentre, r - kCentre) pixels of the
/// searched level.
struct Patch {
  static constexpr int kSize = 8;
  static constexpr int kCentre = 4;
  static constexpr int kArea = kSize * kSize;

  alignas(32) float value[kArea];
  alignas(32) float gradient_u[kArea];  ///< central differences [grey/px]
  alignas(32) float gradient_v[kArea];
  alignas(32) std::int16_t rounded[kArea];
  float deviation = 0;  ///< standard deviation of value [grey]
};

/// How an anchor's surroundings map into a view, for a surface parallel to the anchor's image plane.
struct PatchWarp {
  Eigen::Matrix2d A_c_a;  ///< level-0 pixels of the anchor to level-0 pixels of the view, around the point
  Vector2 uv;             ///< predicted level-0 pixel of the point in the view
  double depth = 0;       ///< of the point in the view [m]
};

/// @return nothing if the point is not in front of the view.
[[nodiscard]] std::optional<PatchWarp> predict_warp(const PinholeCamera& camera, const Vector3& psi,
                                                    const SE3& T_c_a);

/// Level of the view at which the patch is about as large as at `anchor_level` of the anchor; nothing when
/// the pyramid has no level for which its scale stays within [0.5, 2].
[[nodiscard]] std::optional<int> search_level(const Eigen::Matrix2d& A_c_a, int anchor_level);

/// Samples the appearance as it should look at `level` of the view.
void warp_patch(const PointAppearance& appearance, const Eigen::Matrix2d& A_c_a, int level, Patch& patch);

/// The patch in other light: all of it times `gain`, the mean at most white.
void scale_contrast(Patch& patch, float gain);

/// Patch around a whole pixel as it stands; false when too near to the border.
[[nodiscard]] bool cut_patch(const cv::Mat& level_image, int u, int v, Patch& patch);

/// Copies an appearance out of a pyramid level around a whole pixel; false when too near to the border.
[[nodiscard]] bool cut_appearance(const cv::Mat& level_image, int u, int v, int level,
                                  PointAppearance& appearance);

/// Sum of squared differences between the patch (corner at whole pixel (u, v)) and the image, means removed.
/// The patch must lie inside the image.
[[nodiscard]] int zero_mean_ssd(const Patch& patch, const cv::Mat& image, int u, int v);

/// The same for a stretch of a row: cost[i] is that at (u + i, v), at a fraction of the time. At most
/// kMaxRowCosts of them; up to a pixel right of the last patch is read.
inline constexpr int kMaxRowCosts = 1024;
void zero_mean_ssd_row(const Patch& patch, const cv::Mat& image, int u, int v, std::span<int> cost);

struct AlignmentResult {
  Eigen::Vector2f uv;  ///< corner in pixels of the image's level
  float rms = 0;       ///< of the remaining differences, gain and offset removed [grey]
};

/// Inverse compositional Lucas-Kanade over (u, v, gain, offset) (Baker and Matthews, 2004): sub-pixel
/// position of the patch near `start`. Nothing when it runs out of the image, moves more than 2.5 px, or does
/// not settle.
[[nodiscard]] std::optional<AlignmentResult> align_patch(const Patch& patch, const cv::Mat& image,
                                                         const Eigen::Vector2f& start, int max_iterations);
/// The same along the row only: v stays.
[[nodiscard]] std::optional<AlignmentResult> align_patch_in_row(const Patch& patch, const cv::Mat& image,
                                                                const Eigen::Vector2f& start,
                                                                int max_iterations);

}  // namespace twofold
