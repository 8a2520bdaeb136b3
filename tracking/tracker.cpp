#include "tracking/tracker.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include "geometry/inverse_depth.hpp"
#include "imaging/image_buffers.hpp"

namespace twofold {
namespace {

constexpr std::size_t kMaxCandidates = 3000;
constexpr std::size_t kMaxImmaturePoints = 1200;
constexpr std::size_t kMaxPending = 12;
constexpr std::size_t kMaxSeeds = 600;
constexpr std::size_t kMaxAlignmentPoints = 240;
constexpr std::size_t kRecentViews = 4;
constexpr int kRoundsFromRough = 3;

/// A pose that few points agree on, of few that were found, or very few at all: a wider search may know a
/// better one.
bool hardly_supported(const TrackResult& result, const TrackerOptions& options) {
  return result.inliers < options.doubted_searched_share * result.searched ||
         (result.inliers < options.doubted_inlier_share * result.matches &&
          result.inliers < options.rough_searched_share * result.searched);
}

RecentView room_for_view(const Rig& rig, const WideSearch& search) {
  RecentView view;
  allocate_images(rig, view.images);
  search.prepare(view.corners);
  return view;
}

}  // namespace

Tracker::Tracker(const Rig& rig, const TrackerOptions& options)
    : rig_(rig),
      options_(options),
      dense_alignment_(kMaxAlignmentPoints, options.alignment),
      local_map_(kMaxCandidates),
      quadtree_(rig.camera.width, rig.camera.height, kMaxCandidates),
      wide_search_(rig, options.wide_search),
      recent_views_(kRecentViews, room_for_view(rig, wide_search_)),
      elder_vote_(rig, static_cast<std::size_t>(options.max_searches), options.elders),
      uncertainty_(rig),
      immature_points_(kMaxImmaturePoints, kMaxPending),
      starter_(rig, rig.kind == SensorKind::kMono ? with_cells_of_one_camera(rig, options) : options),
      seeds_(rig, options.search, options.seeds, kMaxSeeds) {
  const auto searches = static_cast<std::size_t>(options.max_searches);
  matches_.reserve(searches);
  missed_.reserve(searches);
  motion_.reserve(searches);
  anchors_.reserve(searches);
  inlier_ids_.reserve(searches);
  samples_.reserve(std::max({searches, kMaxImmaturePoints, kMaxAlignmentPoints}));
  previous_points_.reserve(kMaxAlignmentPoints);
  new_corners_.reserve(static_cast<std::size_t>(options.max_new_points));
  if (rig.kind == SensorKind::kStereo) right_rows_.emplace(rig);
  if (!rig.readout) readout_.emplace(rig, searches);
  if (rig.kind == SensorKind::kRgbd) depth_alignment_.emplace(rig, options.depth);
  if (rig.kind == SensorKind::kMono) monocular_start_.emplace(rig, options);
  allocate_images(rig, current_);
  allocate_images(rig, previous_);
  wide_search_.prepare(previous_corners_);
  asked_ = room_for_view(rig, wide_search_);
}

TrackResult Tracker::step(const Frame& frame, const GraphSnapshot& graph, KeyframeProposal* free_proposal,
                          EffortLevel effort) {
  FrameStep step = locate(frame, graph, free_proposal, effort);
  prepare_next(step);
  return step.result;
}

FrameStep Tracker::locate(const Frame& frame, const GraphSnapshot& graph, KeyframeProposal* free_proposal,
                          EffortLevel effort) {
  FrameStep step(frame, graph, free_proposal, bounds_of(effort, options_));
  ++frames_;
  earlier_frames_.clear();
  loss_.begin_frame(frame.index, frame.t_ns);
  load_images(frame);
  step.lap(TrackerStage::kPyramid);
  const bool map_exists = last_.reference != kNoKeyframe || unplaced_;
  if (map_exists) follow(graph);
  step.tracked = map_exists && track(step);
  if (step.tracked && seeds_.size() > 0) observe_seeds(step);
  if (step.tracked) step.result.proposed = keyframe_is_due(step);
  step.started = !step.tracked && (map_exists ? start_part(step) : start_map(step));
  step.lap(TrackerStage::kKeyframe);
  return step;
}

void Tracker::prepare_next(FrameStep& step) {
  step.resume();
  if (step.tracked && step.result.proposed) propose_keyframe(step);
  if (step.tracked || step.started) remember_frame(step);
  if (step.tracked && !step.result.proposed && !step.result.by_depth) revisit_reference(step.graph);
  step.lap(TrackerStage::kKeyframe);
}

/// Pose of the frame relative to a reference keyframe, from the points of the map around that.
bool Tracker::track(FrameStep& step) {
  const auto asked = recognised(step.graph);
  if (asked && search_from_recognised(*asked, step)) return true;
  if (last_.reference == kNoKeyframe) {
    give_up_frame(LostCause::kUnplaced, step.result);
    return false;
  }
  SearchStart start{.placement = last_, .rough = false};
  local_map_.update(step.graph, start.placement.reference, immature_points_, options_.neighbour_keyframes);
  step.lap(TrackerStage::kCandidates);
  if (search_ahead(step)) return true;
  const bool by_depth = corners_scarce_ && depth_can_place();
  start.placement.T_c_ref = by_depth ? align_to_depth(step) : aligned_pose(step);
  step.lap(TrackerStage::kAlignment);
  LostCause cause = by_depth ? search_from(start, step) : search_from_either(start, step);
  if (cause == LostCause::kNone && loss_.lost_frames() > 0 && !is_within_reach(options_.coast_for, step))
    cause = LostCause::kInconsistentMatches;
  if (place_by_both(start.placement.T_c_ref, cause, step)) return true;
  const bool doubted = cause == LostCause::kNone && hardly_supported(step.result, options_);
  if ((cause == LostCause::kNone && !doubted) || search_widely(step)) return true;
  if (doubted) {  // nothing better
    local_map_.update(step.graph, start.placement.reference, immature_points_, options_.neighbour_keyframes);
    cause = search_from(start, step);
  }
  if (cause != LostCause::kNone) cause = place_by_depth_alone(cause, step);
  if (cause != LostCause::kNone) give_up_frame(cause, step.result);
  return cause == LostCause::kNone;
}

/// Points where they should be, where they are, and the pose that fits: once from a good start, a few times
/// from a rough one.
LostCause Tracker::search_from(SearchStart start, FrameStep& step) {
  SE3& T_c_ref = start.placement.T_c_ref;
  step.shutter = start.rough ? RollingShutter() : shutter_at(T_c_ref, step.frame);
  LostCause cause = LostCause::kNone;
  const int rounds = start.rough ? kRoundsFromRough : 1;
  for (int round = 0; cause == LostCause::kNone && round < rounds; ++round) {
    const bool wide = start.rough ? round + 1 < rounds : loss_.lost_frames() > 0;
    select_candidates(T_c_ref, step.result);
    step.lap(TrackerStage::kCandidates);
    search_points(T_c_ref, wide ? options_.lost_radius_px : options_.search.radius_px, step);
    step.lap(TrackerStage::kSearch);
    cause = estimate_pose(start.placement, step);
    T_c_ref = step.result.T_c_ref;
    step.lap(TrackerStage::kMotion);
  }
  const bool doubtful = cause == LostCause::kNone && start.rough && !well_supported(step.result);
  return doubtful ? LostCause::kInconsistentMatches : cause;
}

void Tracker::load_images(const Frame& frame) {
  current_.left.build(frame.left);
  if (right_rows_) {
    current_.right.build(right_rows_->aligned(frame.right));
    if (right_rows_->look_at_start(frame.left, current_.right.level(0)))
      current_.right.build(right_rows_->aligned(frame.right));
  }
  if (rig_.kind == SensorKind::kRgbd) frame.depth.copyTo(current_.depth);
}

/// A newer map: take over what it confirmed, and move the reference to the newest own keyframe in it.
void Tracker::follow(const GraphSnapshot& graph) {
  if (graph.version() == local_map_.version()) return;
  const PendingKeyframe* newest = nullptr;
  for (const PendingKeyframe& pending : immature_points_.pending()) {
    if (graph.contains(pending.id) && !graph.keyframe(pending.id).culled()) newest = &pending;
  }
  if (newest != nullptr && newest->id != last_.reference) {
    // As it was tracked, not as the map has it now: both frames were placed by the same points.
    const SE3 T_ref_new = relative_pose(graph, immature_points_, last_.reference, newest->reference) *
                          newest->T_k_ref.inverse();
    last_ = {newest->id, last_.T_c_ref * T_ref_new};
  }
  immature_points_.adopt(graph);
  if (graph.contains(last_.reference) && graph.keyframe(last_.reference).culled()) {
    const auto replacement = graph.live_replacement(last_.reference);
    TWOFOLD_CHECK(replacement, "the reference was culled too long ago");
    last_ = {replacement->id, last_.T_c_ref * replacement->T_this_live};
  }
}

/// Since the last good frame: constant velocity, none after a loss.
SE3 Tracker::predicted_motion() const {
  return loss_.lost_frames() > 0 ? SE3() : T_cur_prev_;
}

SE3 Tracker::predicted_pose() const {
  return predicted_motion() * last_.T_c_ref;
}

/// Dense 3D Lucas-Kanade from the last good frame (eq. 6.7), started from the motion since, then from rest.
/// @return the motion; nothing if it is not to be trusted
std::optional<SE3> Tracker::align_to_previous(const SE3& start, FrameStep& step) {
  if (previous_points_.empty()) return std::nullopt;
  DenseAlignmentResult best =
      dense_alignment_.align(rig_.camera, previous_.left, current_.left, previous_points_, start,
                             step.bounds.finest_alignment_level);
  if (step.bounds.align_from_rest && (!best.converged || best.rms > 0.5 * options_.max_alignment_rms)) {
    const DenseAlignmentResult rest =
        dense_alignment_.align(rig_.camera, previous_.left, current_.left, previous_points_, SE3(),
                               step.bounds.finest_alignment_level);
    if (rest.converged && (!best.converged || rest.rms < best.rms)) best = rest;
  }
  step.result.alignment_rms = best.rms;
  const bool trusted = best.converged && best.rms < options_.max_alignment_rms;
  return trusted ? std::optional(best.T_cur_prev) : std::nullopt;
}

SE3 Tracker::aligned_pose(FrameStep& step) {
  const SE3 start = predicted_motion();
  return align_to_previous(start, step).value_or(start) * last_.T_c_ref;
}

/// What the next frame starts from.
void Tracker::remember_frame(const FrameStep& step) {
  const TrackResult& result = step.result;
  const bool goes_on = loss_.lost_frames() == 0 && result.reference == last_.reference;
  last_velocity_ = goes_on ? velocity_at(result.T_c_ref, step.frame) : std::nullopt;
  T_cur_prev_ = goes_on ? result.T_c_ref * last_.T_c_ref.inverse() : SE3();
  last_ = {result.reference, result.T_c_ref};
  last_t_ns_ = step.frame.t_ns;
  if (readout_) learn_readout(step, goes_on);
  loss_.placed();
  unplaced_ = false;
  previous_points_.clear();
  for (std::size_t m = 0; m < matches_.size() && previous_points_.size() < previous_points_.capacity(); ++m) {
    if (!motion_[m].inlier) continue;
    const Vector3& z = matches_[m].found.z;
    const SE3 T_row_ref = step.shutter.seen_from(rig_, last_.T_c_ref, motion_[m].x_ref);
    previous_points_.push_back({z.head<2>().cast<float>(), T_row_ref * motion_[m].x_ref});
  }
  for (const ImmaturePoint& point : immature_points_.points()) {
    if (previous_points_.size() == previous_points_.capacity()) break;
    if (rig_.kind == SensorKind::kMono) break;  // it has no depth where it starts a point
    const bool started_in_this_frame = result.proposed && index(point.anchor) + 1 == next_.keyframe;
    if (!started_in_this_frame) continue;
    const Vector3 x_c = from_inverse_depth(point.psi);
    previous_points_.push_back({point.appearance.uv, step.shutter.seen_from(rig_, SE3(), x_c) * x_c});
  }
  previous_corners_.clear();
  previous_is_keyframe_ = result.proposed;
  corners_scarce_ = result.by_depth;
  std::swap(current_, previous_);
  if (monocular_start_) monocular_start_->reset();
}

}  // namespace twofold
