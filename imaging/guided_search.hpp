#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "camera/measurement.hpp"
#include "camera/rig.hpp"
#include "geometry/se3.hpp"
#include "imaging/image_pyramid.hpp"
#include "imaging/patch.hpp"
#include "imaging/point_appearance.hpp"

namespace twofold {

struct GuidedSearchOptions {
  double radius_px = 3;        ///< search radius around the prediction, in pixels of the searched level, > 0
  float max_rms = 14;          ///< of a match, gain and offset removed [grey] > 0
  float max_rms_share = 0.6F;  ///< ... share of the patch's own standard deviation, beyond `noise`, > 0
  float noise = 3;             ///< grey levels two views of the same surface differ by anyway, >= 0
  int refine_iterations = 12;  ///< upper bound of sub-pixel Lucas-Kanade steps, >= 1
  double right_search_px = 6;  ///< stereo: half range in the row around the predicted u_r, level pixels, > 0
  float gain = 1;              ///< contrast of the view over that of the patch, as far as known before, > 0

  /// Empty when valid; otherwise names the field, the rule and the value.
  [[nodiscard]] std::string invalid_reason() const;
};

struct PointMatch {
  StereoPixel pixel{0, 0, 0};  ///< without a right coordinate if it was not found in the right image
  int level = 0;               ///< pyramid level of the match: its noise is Rig::noise of that level
  float rms = 0;               ///< remaining difference [grey]
};

/// Looks for a known point in a new view: warps its patch to the view, compares it at every pixel within a
/// small radius, refines to sub-pixel, and finds it in the right image along the row (or reads the depth
/// image). Thesis 3.4.2 and 6.3. No allocation, bounded work.
///
/// @param psi    inverse depth coordinates of the point in its anchor frame
/// @param T_c_a  pose of the view relative to the anchor: x_c = T_c_a x_a  [m]
/// @return nothing when the point is behind or outside the view, seen at a too different scale, or not found.
[[nodiscard]] std::optional<PointMatch> find_point(const FrameImages& images, const Rig& rig,
                                                   const PointAppearance& appearance, const Vector3& psi,
                                                   const SE3& T_c_a, const GuidedSearchOptions& options);

/// Brightness of a view where a point should be seen over that of its patch: about the change of light since
/// the anchor was taken, for the median of many points. Nothing when the point is not in view, or black.
[[nodiscard]] std::optional<float> brightness_since_anchor(const ImagePyramid& images,
                                                           const PinholeCamera& camera,
                                                           const PointAppearance& appearance,
                                                           const Vector3& psi, const SE3& T_c_a);

/// Right coordinate that a depth image gives a left pixel: median of the valid readings of the 3x3 pixels
/// around it, as u_r = u_l - f b / depth  (thesis 6.5.3). NaN at holes and where the readings jump (depth
/// edges).
[[nodiscard]] double right_from_depth(const cv::Mat& depth, const Rig& rig, double u, double v);

/// Right coordinate of a left pixel whose depth is unknown: searches the row over the whole range of
/// disparities, refuses ambiguous and one-way matches (left-right check), refines to sub-pixel. NaN when
/// there is none.
/// @param u, v  whole pixels of `level`
[[nodiscard]] double right_from_row(const FrameImages& images, const Rig& rig, int u, int v, int level,
                                    const GuidedSearchOptions& options);

/// The same in two images of `level` of which a row of one belongs to the same row of the other.
[[nodiscard]] double right_from_row(const cv::Mat& left, const cv::Mat& right, const Rig& rig, int u, int v,
                                    int level, const GuidedSearchOptions& options);

/// Right coordinate of a corner whose depth is unknown, from the right image or the depth image, whichever
/// the rig has. NaN when there is none.
/// @param uv  level-0 pixel of a whole pixel of `level`
[[nodiscard]] double right_of_corner(const FrameImages& images, const Rig& rig, const Vector2& uv, int level,
                                     const GuidedSearchOptions& options);

/// Whether what is left of the difference [grey] between a patch and where it was found is small enough.
[[nodiscard]] bool looks_alike(const Patch& patch, float rms, const GuidedSearchOptions& options);

/// Whether a match is unambiguous: the best SSD is so much smaller than the second best, found away from the
/// best; both as zero_mean_ssd measures it.
[[nodiscard]] bool is_unambiguous(std::int64_t best, std::int64_t second);

}  // namespace twofold
