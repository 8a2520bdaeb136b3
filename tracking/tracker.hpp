#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "camera/frame.hpp"
#include "camera/rig.hpp"
#include "graph/keyframe_proposal.hpp"
#include "graph/snapshot.hpp"
#include "tracking/dense_alignment.hpp"
#include "tracking/effort.hpp"
#include "tracking/immature_points.hpp"
#include "tracking/local_map.hpp"
#include "tracking/options.hpp"
#include "tracking/point_starter.hpp"
#include "tracking/quadtree.hpp"
#include "tracking/track_result.hpp"

namespace twofold {

/// From images to poses: the stereo front-end of thesis 6.3, RGB-D as stereo with a virtual right image
/// (6.5.3).
///
/// Single-threaded and deterministic. After construction nothing is allocated, keyframes included if their
/// buffers were prepared, and no reference count of a snapshot is touched. Work per frame is bounded by the
/// options.
///
/// The tracker numbers keyframes when it proposes them and points when they are found a second time. Its own
/// pose is relative to a reference keyframe, so that it moves along when a newer snapshot moves that
/// keyframe.
class Tracker {
 public:
  Tracker(const Rig& rig, const TrackerOptions& options);

  /// Makes room in a buffer for the largest keyframe proposal that this tracker can fill it with.
  void prepare(KeyframeProposal& proposal) const;

  /// Tracks one frame against `graph`, which must stay alive while later calls get the same version.
  /// @param free_proposal  buffer for a keyframe proposal, or null: no keyframe can be made in this frame.
  ///                       Filled if and only if the result says `proposed`.
  /// @param effort           what to leave out
  TrackResult step(const Frame& frame, const GraphSnapshot& graph, KeyframeProposal* free_proposal,
                   EffortLevel effort = EffortLevel::kEverything);

  /// Goes on with a map made before: the numbers of keyframes and points continue its own, and the camera is
  /// lost until `relocalise` says where in it the camera is, or until a new part is started. To be called
  /// before the first step.
  void continue_from(const GraphSnapshot& graph);
  /// The camera was not placed yet in the map it was to continue in, nor in a new part.
  [[nodiscard]] bool unplaced() const { return unplaced_; }

  /// Pose of the last tracked frame in the map as `graph`, that of the last step, has it.
  [[nodiscard]] SE3 T_c_w(const GraphSnapshot& graph) const {
    return T_prev_ref_ * pose_in_world(graph, immature_points_, reference_);
  }

  /// Images of the last step's frame, if that was lost.
  [[nodiscard]] const FrameImages& lost_images() const { return current_; }
  /// Frames since the last one with a pose.
  [[nodiscard]] int lost_frames() const { return lost_frames_; }
  /// Map part of the last tracked frame, as `graph`, that of the last step, has it.
  [[nodiscard]] KeyframeId part(const GraphSnapshot& graph) const {
    return part_of(graph, immature_points_, reference_);
  }

  /// Hint of the loop closer: the camera was recognised at T_c_k relative to keyframe `id`. The next step, if
  /// its graph has the keyframe, looks for points around there, and forgets the hint. Ignored while tracking.
  void relocalise(KeyframeId id, const SE3& T_c_k);

  /// What the last step measured, points in the reference keyframe's frame, outliers included: for drawing
  /// and diagnosis. Valid until the next step.
  [[nodiscard]] std::span<const MotionObservation> last_observations() const { return motion_; }

 private:
  class StageClock;
  struct Match {
    std::uint32_t point;  ///< position in local_map_.points()
    PointMatch found;
  };

  void load_images(const Frame& frame);
  void adopt(const GraphSnapshot& graph);
  bool start_map(const Frame& frame, KeyframeProposal* proposal, TrackResult& result);
  bool take_hint(const GraphSnapshot& graph);
  bool track(const GraphSnapshot& graph, bool hinted, StageClock& clock, TrackResult& result);
  bool start_part(const Frame& frame, KeyframeProposal* proposal, TrackResult& result);
  [[nodiscard]] bool new_part_due(std::int64_t t_ns);
  SE3 align_to_previous(TrackResult& result);
  void select_candidates(const SE3& T_c_ref, TrackResult& result);
  void search_points(const SE3& T_c_ref, TrackResult& result);
  bool estimate_pose(const SE3& T_c_ref_start, TrackResult& result);
  void give_up_frame(LostCause cause, TrackResult& result);
  void remember_frame(const SE3& T_c_ref);

  [[nodiscard]] bool keyframe_due(const TrackResult& result, const SE3& T_c_ref) const;
  void propose_keyframe(const Frame& frame, const GraphSnapshot& graph, KeyframeProposal& proposal,
                        TrackResult& result);
  void hand_over_images(KeyframeProposal& proposal);
  void collect_observations(KeyframeProposal& proposal);
  void confirm(ImmaturePoint& point, KeyframeProposal& proposal);
  void start_points(KeyframeId anchor);
  void revisit_reference(const GraphSnapshot& graph);
  [[nodiscard]] int occupied_regions() const;
  [[nodiscard]] double median_depth(const SE3& T_c_ref);

  Rig rig_;
  TrackerOptions options_;
  EffortBounds bounds_;  ///< of this step
  FrameImages current_, previous_;
  DenseAlignment alignment_;
  LocalMap local_map_;
  Quadtree quadtree_;
  ImmaturePoints immature_points_;
  PointStarter starter_;

  KeyframeId reference_ = kNoKeyframe;
  bool unplaced_ = false;
  SE3 T_prev_ref_;  ///< last good pose
  SE3 T_cur_prev_;  ///< last good motion, the prediction of the next
  std::uint64_t graph_version_ = 0;
  bool local_map_stale_ = true;
  int lost_frames_ = 0;
  FrameIntervals intervals_;
  LostCause gap_before_loss_ = LostCause::kNone;  ///< between the last good frame and the next
  KeyframeId hint_keyframe_ = kNoKeyframe;        ///< of relocalise
  SE3 hint_T_c_k_;
  std::uint32_t frames_ = 0;
  std::int64_t seeing_since_ns_ = 0;  ///< lost, but with corners in view, since then; 0: not

  std::uint32_t next_keyframe_ = 0;
  std::uint32_t first_of_part_ = 0;  ///< the newest part's
  std::uint32_t next_point_ = 0;
  int regions_at_keyframe_ = 0;
  double keyframe_depth_ = 0;  ///< median depth at the last keyframe [m]

  std::vector<Match> matches_;
  std::vector<MotionObservation> motion_;
  std::vector<AlignmentPoint> previous_points_;
  std::vector<PointId> inlier_ids_;
  std::vector<double> depths_;
  int visible_reference_points_ = 0;
};

}  // namespace twofold
