#pragma once

#include <optional>

#include "camera/rig.hpp"
#include "geometry/se3.hpp"
#include "graph/place_appearance.hpp"
#include "loopclosure/geometric_verification.hpp"

namespace twofold {

/// First step of verify_place: the pose T_b_a that explains most of the matches between b and the place's own
/// view a, if enough of them agree for it to be worth trying.
/// @param report  matches and ransac_inliers are set
[[nodiscard]] std::optional<SE3> find_pose_hypothesis(const Rig& rig, const PlaceAppearance& a,
                                                      const PlaceAppearance& b,
                                                      const VerificationOptions& options,
                                                      VerificationReport& report);

}  // namespace twofold
