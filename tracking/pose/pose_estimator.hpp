#pragma once

#include <vector>

#include "camera/rig.hpp"
#include "estimation/pose_uncertainty.hpp"
#include "tracking/common/elder_vote.hpp"
#include "tracking/common/frame_step.hpp"
#include "tracking/common/immature_points.hpp"
#include "tracking/common/local_map.hpp"
#include "tracking/motion/shutter_model.hpp"
#include "tracking/options.hpp"
#include "tracking/search/local_map_search.hpp"

namespace twofold {

/// A frame's pose from the points of the local map that were found in it, how well it is known, and what it
/// says about the immature points.
///
/// One instance a tracker: it remembers whom it mistrusts, and how residuals were. No allocation after
/// construction.
class PoseEstimator {
 public:
  /// All must outlive this.
  PoseEstimator(const Rig& rig, const TrackerOptions& options, const LocalMap& local_map,
                const ShutterModel& shutter, ImmaturePoints& immature_points);

  /// Motion-only bundle adjustment (eq. 3.34), and whether its result can be trusted. Counts matches and
  /// misses of the tracker's immature points in either case: a frame that is searched from several starts
  /// counts several times, so that doubtful points are given up sooner. Where rows are read one after the
  /// other, the step's shutter becomes that of the pose.
  /// @param start  where the search looked from; its reference is the result's
  /// @param found  what the search came to, whose observations, motion and verdict are filled in
  /// @return kNone, and the step's result has the pose; or why there is none
  LostCause estimate(const Placement& start, FrameStep& step, SearchOutcome& found);

  /// A pose from a rough start is believed when the map's points are found where they should be seen from
  /// there: from a wrong one some are found as well, but few agree. Few points that were measured from one
  /// place only all agree, and are all wrong by their depths' errors.
  [[nodiscard]] bool well_supported(const TrackResult& result, const SearchOutcome& found) const;

  /// Inliers whose depth is known.
  [[nodiscard]] int inliers_with_depth(const SearchOutcome& found) const;

  /// ElderVote::mistrusts_the_young.
  [[nodiscard]] bool mistrusts_the_young() const { return elder_vote_.mistrusts_the_young(); }

 private:
  [[nodiscard]] float certainty(const TrackedPoint& point, const SE3& T_c_ref) const;
  void observe(const SE3& T_c_ref, const RollingShutter& shutter, SearchOutcome& found) const;
  void ask_elders(const MotionOnlyOptions& solver, SearchOutcome& found);
  int judge_immature_points(const SearchOutcome& found);
  [[nodiscard]] Matrix6 honest_information(const FrameStep& step, const SearchOutcome& found);
  [[nodiscard]] MotionOnlyOptions solver(const FrameStep& step) const;
  [[nodiscard]] int mapped_inliers(const SearchOutcome& found) const;

  const Rig& rig_;
  const TrackerOptions& options_;
  const LocalMap& local_map_;
  const ShutterModel& shutter_;
  ImmaturePoints& immature_points_;
  ElderVote elder_vote_;
  PoseUncertainty uncertainty_;
  std::vector<KeyframeId> anchors_;  ///< scratch
};

}  // namespace twofold
