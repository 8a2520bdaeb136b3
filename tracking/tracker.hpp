#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "camera/frame.hpp"
#include "camera/rig.hpp"
#include "graph/keyframe_proposal.hpp"
#include "graph/snapshot.hpp"
#include "tracking/common/dense_alignment.hpp"
#include "tracking/common/effort.hpp"
#include "tracking/common/frame_step.hpp"
#include "tracking/common/immature_points.hpp"
#include "tracking/common/local_map.hpp"
#include "tracking/common/lost_cause.hpp"
#include "tracking/common/track_result.hpp"
#include "tracking/depth/depth_alignment.hpp"
#include "tracking/fixed/image_correction.hpp"
#include "tracking/keyframes/keyframe_proposer.hpp"
#include "tracking/keyframes/new_points.hpp"
#include "tracking/keyframes/reference_choice.hpp"
#include "tracking/last_frame.hpp"
#include "tracking/loss/assumed_placements.hpp"
#include "tracking/loss/earlier_views.hpp"
#include "tracking/loss/loss_history.hpp"
#include "tracking/monocular_start.hpp"
#include "tracking/motion/motion_model.hpp"
#include "tracking/motion/shutter_model.hpp"
#include "tracking/options.hpp"
#include "tracking/pose/pose_estimator.hpp"
#include "tracking/search/local_map_search.hpp"

namespace twofold {

/// From images to poses: the stereo front-end of thesis 6.3, RGB-D as stereo with a virtual right image
/// (6.5.3). One camera differs in where a point's depth comes from: at the start from its motion
/// (MonocularStart; of a depth camera, too, where little is within its reach), later from filters along
/// epipolar lines (DepthSeeds); its unit of length is its own.
///
/// Single-threaded and deterministic. Nothing is allocated after construction, except for a start by motion,
/// before there is a map or while the camera is lost and may start again; keyframes included if their buffers
/// were prepared, and no reference count of a snapshot is touched. Work per frame is bounded by the options.
///
/// The tracker's own pose is relative to a reference keyframe, so that it moves along when a newer snapshot
/// moves that keyframe.
class Tracker {
 public:
  Tracker(const Rig& rig, const TrackerOptions& options);
  Tracker(const Tracker&) = delete;
  Tracker& operator=(const Tracker&) = delete;

  /// Makes room in a buffer for the largest keyframe proposal that this tracker can fill it with.
  void prepare(KeyframeProposal& proposal) const;

  /// Where the camera is in a frame, which is tracked against `graph`: that must stay alive while later calls
  /// get the same version. Each call is followed by one of `prepare_next`.
  /// @param free_proposal  buffer for a keyframe proposal, or null: no keyframe can be made in this frame.
  ///                       Filled by the end of `prepare_next` if and only if the result says `proposed`.
  /// @param effort           what to leave out
  FrameStep locate(const Frame& frame, const GraphSnapshot& graph, KeyframeProposal* free_proposal,
                   EffortLevel effort = EffortLevel::kEverything);
  /// What the next frame needs and nobody who waits for this one's pose: the keyframe proposal if one is due,
  /// new points, what is remembered of the frame.
  void prepare_next(FrameStep& step);
  /// Both.
  TrackResult step(const Frame& frame, const GraphSnapshot& graph, KeyframeProposal* free_proposal,
                   EffortLevel effort = EffortLevel::kEverything);

  /// Goes on with a map made before: the numbers of keyframes and points continue its own, and the camera is
  /// lost until `relocalise` says where in it the camera is, or until a new part is started. To be called
  /// before the first step.
  /// @param assumed  where it is looked for meanwhile, from the first frame on; believed as an answer of the
  ///                 loop closer is, if the search for the map's points finds it there
  void continue_from(const GraphSnapshot& graph, const std::optional<AssumedPose>& assumed = std::nullopt);
  /// The camera was not placed yet in the map it was to continue in, nor in a new part.
  [[nodiscard]] bool unplaced() const { return unplaced_; }

  /// Pose of a frame that was just located, in the map that it was tracked against.
  [[nodiscard]] SE3 T_c_w(const FrameStep& step) const {
    return step.result.T_c_ref * pose_in_world(step.graph, immature_points_, step.result.reference);
  }

  /// Images of the last step's frame, which was lost: for the loop closer. They are kept until the next call,
  /// because the answer to `relocalise` says where this frame was taken, and the camera moves on.
  [[nodiscard]] const FrameImages& ask_where() { return views_.ask(current_); }
  /// Frames since the last one with a pose.
  [[nodiscard]] int lost_frames() const { return loss_.lost_frames(); }
  /// Map part of a frame that was just located, in the map that it was tracked against.
  [[nodiscard]] KeyframeId part(const FrameStep& step) const {
    return part_of(step.graph, immature_points_, step.result.reference);
  }

  /// Hint of the loop closer: the frame that `ask_where` was called for was recognised at T_c_k relative to
  /// keyframe `id`. The next step, if its graph has the keyframe, looks for points around there, then for
  /// what that frame shows, and forgets the hint. Ignored while tracking.
  void relocalise(KeyframeId id, const SE3& T_c_k) { views_.answer({id, T_c_k}); }

  /// Rows that a stereo pair's right images lie lower than its left ones, taken back by the tracker [px].
  [[nodiscard]] double row_offset() const { return correction_.row_offset(); }
  /// ShutterModel::readout.
  [[nodiscard]] std::optional<ReadoutEstimate> readout() const { return shutter_.readout(); }

  /// What the last step measured, points in the reference keyframe's frame, outliers included: for drawing
  /// and diagnosis. Valid until the next step.
  [[nodiscard]] std::span<const MotionObservation> last_observations() const { return search_.observations; }

 private:
  // tracker.cpp: the stages of a frame
  void follow(const GraphSnapshot& graph);
  bool track(FrameStep& step);
  std::optional<SE3> align_to_previous(const SE3& start, FrameStep& step);
  SE3 aligned_pose(FrameStep& step);
  void remember_frame(const FrameStep& step);
  void learn_fixed_pixels(const FrameStep& step);

  // tracker_search.cpp: a pose from points
  void collect_local_map(KeyframeId reference, const FrameStep& step);
  LostCause search_from(SearchStart start, FrameStep& step);
  LostCause search_from_either(const SearchStart& aligned, FrameStep& step);
  [[nodiscard]] bool leaves_motion(const SE3& T_c_ref, const FrameStep& step);
  [[nodiscard]] Attempt set_aside(const FrameStep& step);
  void take_back(const Attempt& attempt, FrameStep& step);

  // tracker_loss.cpp: where a lost camera is looked for
  [[nodiscard]] std::optional<Placement> recognised(const FrameStep& step);
  bool search_from_recognised(const Placement& asked, FrameStep& step);
  bool search_from_assumed(FrameStep& step);
  void leave_other_part(const FrameStep& step);
  [[nodiscard]] std::optional<Placement> placement_of(const GraphSnapshot& graph, KeyframeId id) const;
  /// Of the map; also of keyframes that it has not got yet.
  [[nodiscard]] bool in_same_part(KeyframeId a, KeyframeId b, const GraphSnapshot& graph) const;
  [[nodiscard]] std::optional<Placement> placement_in_this_part(KeyframeId id, const FrameStep& step) const;
  bool search_widely(FrameStep& step);
  bool search_from_view(const FrameImages& images, FrameCorners& corners, const SearchStart& view,
                        FrameStep& step);
  bool search_ahead(FrameStep& step);
  [[nodiscard]] bool is_within_reach(SearchStart::Kind kind, const FrameStep& step) const;
  void give_up_frame(LostCause cause, TrackResult& result);

  // tracker_start.cpp: a new map, and new parts of it
  bool start_map(FrameStep& step);
  bool start_part(FrameStep& step);
  LostCause make_first_keyframe(FrameStep& step);

  // tracker_depth.cpp: a depth camera where there are hardly any corners
  [[nodiscard]] bool depth_can_place(const FrameStep& step) const;
  void read_depth(FrameStep& step);
  tl::expected<DepthAlignment::Result, LostCause> align_depth(const SE3& T_c_ref,
                                                              std::span<const MotionObservation> corners,
                                                              FrameStep& step);
  SE3 align_to_depth(FrameStep& step);
  bool place_by_both(const SE3& T_c_ref, LostCause found, FrameStep& step);
  bool may_be_placed(bool agree, FrameStep& step);
  [[nodiscard]] bool turns_away(const SE3& T_c_ref, const FrameStep& step) const;
  LostCause place_by_depth_alone(LostCause found, FrameStep& step);
  bool points_allow(FrameStep& step);
  LostCause place_by_depth(const SE3& T_c_ref, FrameStep& step);
  LostCause judge_structure(FrameStep& step);
  bool sees_structure(FrameStep& step);

  // tracker_one_camera.cpp: depth from motion
  LostCause start_from_motion(FrameStep& step);
  LostCause confirm_start(const MonocularStartResult& start, FrameStep& step);
  [[nodiscard]] ImmaturePoint point_of_start(const MonocularStartResult& start, std::size_t n,
                                             KeyframeId id) const;
  void observe_seeds(const FrameStep& step);
  [[nodiscard]] bool needs_rays(const TrackResult& result);

  // tracker_keyframes.cpp
  [[nodiscard]] TrackedView tracked_view() const;
  [[nodiscard]] KeyframeView view_of(const FrameStep& step);
  void propose_keyframe(FrameStep& step);
  void hand_over_images(KeyframeProposal& proposal);
  void revisit_reference(const GraphSnapshot& graph);
  [[nodiscard]] double median_depth(const SE3& T_c_ref);

  const Rig rig_;
  const TrackerOptions options_;

  MotionModel motion_;
  ShutterModel shutter_;
  ImageCorrection correction_;
  FrameImages current_;
  LastFrame last_;
  LocalMap local_map_;
  DenseAlignment dense_alignment_;
  LocalMapSearch local_map_search_;
  ImmaturePoints immature_points_;
  PoseEstimator pose_estimator_;
  SearchOutcome search_, tried_;                   ///< of the newest frame, and of another start for it
  std::optional<DepthAlignment> depth_alignment_;  ///< RGB-D only

  LossHistory loss_;
  EarlierViews views_;
  AssumedPlacements assumed_;
  bool unplaced_ = false;

  NewPoints new_points_;
  std::optional<MonocularStart> monocular_start_;  ///< but for stereo
  KeyframeProposer proposer_;
  ReferenceChoice reference_choice_;

  // Scratch.
  std::vector<double> samples_;
};

}  // namespace twofold
