#pragma once

#include <cstdint>
#include <vector>

#include "camera/rig.hpp"
#include "estimation/motion_only.hpp"
#include "imaging/guided_search.hpp"
#include "tracking/common/elder_vote.hpp"
#include "tracking/common/frame_step.hpp"
#include "tracking/common/local_map.hpp"
#include "tracking/common/quadtree.hpp"
#include "tracking/fixed/fixed_pixels.hpp"
#include "tracking/search/options.hpp"

namespace twofold {

/// What one search for the local map's points came to: where they were found, and the pose that fits. Kept
/// while another start is tried (Tracker::set_aside).
struct SearchOutcome {
  struct Match {
    std::uint32_t point;  ///< position in the local map's points
    PointMatch found;
  };

  /// @param max_searches  points searched at most
  SearchOutcome(const Rig& rig, int max_searches);
  void clear();

  Quadtree candidates;                ///< points that should be visible; those not searched are left
  std::vector<Match> matches;         ///< in the order of the search
  std::vector<std::uint32_t> missed;  ///< positions in the local map's points
  std::vector<MotionObservation> observations;  ///< of matches, one each
  MotionOnlyResult motion;                      ///< by all of them
  ElderVote::Verdict verdict;
};

/// From where the camera should be to where points of the local map are found. No allocation after
/// construction.
class LocalMapSearch {
 public:
  /// All must outlive this.
  LocalMapSearch(const Rig& rig, const LocalMapSearchOptions& options, const GuidedSearchOptions& guided,
                 const LocalMap& local_map, const FixedPixels& fixed);

  /// Points that should be visible from T_c_ref (thesis 6.2.5), by guided search in equi-distributed order
  /// (thesis 3.4.3) until enough were found. Observations, motion and verdict are left to the caller.
  /// @param radius_px  around the predictions, in pixels of each point's pyramid level
  void run(const FrameImages& images, const SE3& T_c_ref, double radius_px, FrameStep& step,
           SearchOutcome& outcome);

 private:
  /// Where all points of one search are looked for.
  struct SearchedView {
    const FrameImages& images;
    const SE3& T_c_ref;
    const RollingShutter& shutter;
    GuidedSearchOptions options;
  };

  [[nodiscard]] bool says_where_it_is(const TrackedPoint& point, const Vector3& view_ref) const;
  void select_candidates(const SE3& T_c_ref, TrackResult& result, Quadtree& candidates) const;
  [[nodiscard]] bool search_point(std::uint32_t point, const SearchedView& view,
                                  SearchOutcome& outcome) const;
  void search_in_other_light(SearchedView& view, int searched, SearchOutcome& outcome);

  const Rig& rig_;
  const LocalMapSearchOptions& options_;
  const GuidedSearchOptions& guided_;
  const LocalMap& local_map_;
  const FixedPixels& fixed_;  ///< of the left camera
  std::vector<double> gains_;
};

}  // namespace twofold
