#pragma once

#include <optional>
#include <span>

#include "camera/rig.hpp"
#include "estimation/motion_only.hpp"
#include "mapping/options.hpp"

namespace twofold {

/// Pose that explains most of the matches, of which most may be wrong: three-point RANSAC on the points that
/// have a right coordinate, hence a position in both frames (Arun, thesis eq. 5.11 - 5.14 and 6.9). Residuals
/// are reprojection errors in the left image in standard deviations.
///
/// @return nothing when fewer than `min_inliers` matches agree
[[nodiscard]] std::optional<SE3> consensus_pose(const Rig& rig, std::span<const MotionObservation> matches,
                                                int min_inliers, const LoopConsensusOptions& options);

}  // namespace twofold
