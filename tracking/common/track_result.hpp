#pragma once

#include <array>
#include <cstdint>

#include "geometry/se3.hpp"
#include "graph/ids.hpp"
#include "tracking/common/lost_cause.hpp"

namespace twofold {

enum class TrackStatus : std::uint8_t { kInitialising, kTracking, kLost };

enum class TrackerStage : std::uint8_t {
  kPyramid,
  kAlignment,
  kCandidates,
  kSearch,
  kMotion,
  kKeyframe,
  kCount
};
inline constexpr std::size_t kTrackerStages = static_cast<std::size_t>(TrackerStage::kCount);
[[nodiscard]] const char* describe(TrackerStage stage);

struct TrackResult {
  TrackStatus status = TrackStatus::kInitialising;
  LostCause cause = LostCause::kNone;
  KeyframeId reference = kNoKeyframe;
  SE3 T_c_ref;  ///< pose relative to the reference keyframe; meaningful while kTracking
  /// Of T_c_ref, left perturbation (v, omega): with the noise that residuals show, not the rig's.
  Matrix6 information = Matrix6::Zero();
  int candidates = 0;            ///< points that should be visible
  double reference_in_view = 0;  ///< share of the reference keyframe's points that should be visible
  SE3 T_c_ref_predicted;         ///< where points were searched from last
  double search_radius_px = 0;   ///< around the predictions, in pixels of each point's pyramid level
  int searched = 0;
  int matches = 0;
  int inliers = 0;
  int moving = 0;           ///< points found again and again where nothing that stands still would be
  float alignment_rms = 0;  ///< [grey]
  /// The pose is that of DepthAlignment: from the depth image, together with what points were found. The map
  /// takes none of them as observations.
  bool by_depth = false;
  bool by_rays = false;   ///< one camera: rays carried the rotation, points of known depth being few
  bool proposed = false;  ///< a keyframe is due: the free proposal is filled by the end of prepare_next
  std::array<std::int64_t, kTrackerStages> stage_ns{};

  [[nodiscard]] double tracked_share() const {
    return searched > 0 ? static_cast<double>(inliers) / searched : 0;
  }
};

}  // namespace twofold
