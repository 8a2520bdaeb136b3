#pragma once

#include <cstdint>

#include "graph/keyframe_proposal.hpp"
#include "graph/snapshot.hpp"
#include "tracking/common/frame_step.hpp"
#include "tracking/common/immature_points.hpp"
#include "tracking/common/local_map.hpp"
#include "tracking/keyframes/keyframe_decision.hpp"
#include "tracking/options.hpp"
#include "tracking/search/local_map_search.hpp"

namespace twofold {
/// When a frame becomes a keyframe, and what of it the map gets. Numbers keyframes when it proposes them
/// and points when a later keyframe finds them again.
///
/// No allocation, if the proposals' buffers were prepared.
class KeyframeProposer {
 public:
  /// @param options  must outlive this
  KeyframeProposer(SensorKind kind, const TrackerOptions& options)
      : one_camera_(kind == SensorKind::kMono), options_(options) {}

  /// The numbers of keyframes and points continue those of a map made before.
  void continue_from(const GraphSnapshot& graph);

  /// Whether a frame of one camera tracks a place that was seen long ago: enough of its inliers are of
  /// keyframes long before the next one. Rigs do not wait with keyframes, and are not asked.
  [[nodiscard]] bool revisits(const SearchOutcome& found, const LocalMap& local_map) const;
  /// Whether a frame with a pose should become a keyframe. To be asked once of each: later ones are compared
  /// with what it tracks.
  /// @param seen  by the frame
  [[nodiscard]] bool due(const FrameStep& step, const TrackedView& seen,
                         const ImmaturePoints& immature_points);
  /// The number of the keyframe to be proposed next.
  [[nodiscard]] KeyframeId next() const { return KeyframeId{next_keyframe_}; }
  /// Whether this is the keyframe proposed last.
  [[nodiscard]] bool is_newest(KeyframeId id) const { return index(id) + 1 == next_keyframe_; }

  /// Fills the step's free proposal with all but observations, points and images, and sets result.proposed.
  /// @param placement  of the frame, relative to its reference; none for the first of a map part
  /// @param view       what later frames are judged by
  void begin(const Placement& placement, const KeyframeView& view, FrameStep& step,
             ImmaturePoints& immature_points);
  /// Adds the inliers as observations. Immature points that were found again get their numbers and join the
  /// proposal.
  /// @param mistrusts_the_young  those found in a few frames only are left out: chance finds what moves
  /// near
  ///                             where it was
  void add_observations(const SearchOutcome& found, const LocalMap& local_map, bool mistrusts_the_young,
                        ImmaturePoints& immature_points, KeyframeProposal& proposal);

 private:
  void confirm(ImmaturePoint& point, KeyframeProposal& proposal);

  bool one_camera_;
  const TrackerOptions& options_;
  KeyframeView last_;
  std::uint32_t next_keyframe_ = 0;
  std::uint32_t first_of_part_ = 0;  ///< the newest part's first keyframe
  std::uint32_t next_point_ = 0;
};

/// Number of regions of the image, of 8 x 6, in which a point is tracked.
[[nodiscard]] int occupied_regions(const PinholeCamera& camera, const SearchOutcome& found);

}  // namespace twofold
