#pragma once

#include <optional>
#include <string>

#include "camera/pinhole.hpp"
#include "geometry/se3.hpp"
#include "imaging/guided_search.hpp"

namespace twofold {

/// Inverse depths that a point may have in its anchor frame, 0 <= least <= most; 0 is infinity.
struct InverseDepthRange {
  double least = 0;
  double most = 0;
  double likely = 0;  ///< within; says how the patch is expected to look
};

/// The stretch of an epipolar line that a range of inverse depths maps to, on the pyramid level where the
/// patch is about as large as in its anchor.
struct EpipolarStretch {
  int level = 0;
  Eigen::Matrix2d A_c_a;      ///< warp of the anchor's surroundings (imaging/patch.hpp)
  Eigen::Vector2f far, near;  ///< its ends [level px]

  [[nodiscard]] float length_px() const { return (near - far).norm(); }
};

struct EpipolarSearchOptions {
  float step_px = 0.8F;    ///< between the places that are compared [level px] > 0
  float beside_px = 4;     ///< nearer than this two are the same place [level px] >= 0
  float beyond_px = 1.5F;  ///< past the ends, that sub-pixel search may go [level px] >= 0
  /// Of the depth at infinity's ray, that a near point keeps: nearer ones leave the image, in (0, 1].
  double nearest_share = 0.2;

  /// Empty when valid; otherwise names the field, the rule and the value.
  [[nodiscard]] std::string invalid_reason() const;
};

/// @param ray_a  of the point in its anchor frame, at depth 1
/// @return nothing when all of it is behind the view or its scale is too different
[[nodiscard]] std::optional<EpipolarStretch> epipolar_stretch(const PinholeCamera& camera,
                                                              const PointAppearance& appearance,
                                                              const Vector3& ray_a, const SE3& T_c_a,
                                                              const InverseDepthRange& range,
                                                              const EpipolarSearchOptions& line = {});

/// Looks for a point of unknown depth in a new view (thesis 3.4.4): compares its patch along the stretch,
/// refuses what is found at two places, and refines to sub-pixel; the result lies on the line. No allocation;
/// stretches longer than a few hundred pixels are not searched.
[[nodiscard]] std::optional<PointMatch> find_along(const ImagePyramid& images,
                                                   const PointAppearance& appearance,
                                                   const EpipolarStretch& stretch,
                                                   const GuidedSearchOptions& options,
                                                   const EpipolarSearchOptions& line = {});

}  // namespace twofold
