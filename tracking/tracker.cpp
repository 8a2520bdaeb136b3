#include "tracking/tracker.hpp"

#include <algorithm>
#include <utility>

#include "geometry/inverse_depth.hpp"
#include "imaging/image_buffers.hpp"
#include "tracking/effort_bounds.hpp"

namespace twofold {
namespace {

constexpr std::size_t kMaxImmaturePoints = 1200;
constexpr std::size_t kMostPendingKeyframes = 12;  // beyond KeyframeDecisionOptions::max_pending: urgent ones
constexpr std::size_t kMaxAlignmentPoints = 240;

/// A pose that few points agree on, of few that were found, or very few at all: a wider search may know a
/// better one.
bool hardly_supported(const TrackResult& result, const TrackerOptions& options) {
  return result.inliers < options.pose.doubted_searched_share * result.searched ||
         (result.inliers < options.pose.doubted_inlier_share * result.matches &&
          result.inliers < options.pose.rough.searched_share * result.searched);
}

}  // namespace

Tracker::Tracker(const Rig& rig, const TrackerOptions& options)
    : rig_(rig),
      options_(options),
      motion_(options_.motion_model),
      shutter_(rig_, motion_, static_cast<std::size_t>(options.local_map.max_searches), options.shutter),
      correction_(rig, options.fixed, options.right_rows),
      dense_alignment_(kMaxAlignmentPoints, options.alignment),
      local_map_search_(rig_, options_.local_map, options_.search, local_map_, correction_.fixed()),
      immature_points_(kMaxImmaturePoints, kMostPendingKeyframes),
      pose_estimator_(rig_, options_, local_map_, shutter_, immature_points_),
      search_(rig, options.local_map.max_searches),
      tried_(rig, options.local_map.max_searches),
      loss_(options.loss.signs),
      views_(rig, options.loss.wide_search, options.search, options.loss.recent_keyframes),
      new_points_(rig_, options_, correction_.fixed()),
      proposer_(rig.kind, options_),
      reference_choice_(options.reference, static_cast<std::size_t>(options.local_map.max_searches)) {
  const auto searches = static_cast<std::size_t>(options.local_map.max_searches);
  samples_.reserve(std::max({searches, kMaxImmaturePoints, kMaxAlignmentPoints}));
  last_.points.reserve(kMaxAlignmentPoints);
  if (rig.kind == SensorKind::kRgbd) depth_alignment_.emplace(rig, options.depth.alignment);
  if (rig.kind != SensorKind::kStereo) monocular_start_.emplace(rig, options);
  allocate_images(rig, current_);
  allocate_images(rig, last_.images);
  views_.prepare(last_.corners);
}

TrackResult Tracker::step(const Frame& frame, const GraphSnapshot& graph, KeyframeProposal* free_proposal,
                          EffortLevel effort) {
  FrameStep step = locate(frame, graph, free_proposal, effort);
  prepare_next(step);
  return step.result;
}

FrameStep Tracker::locate(const Frame& frame, const GraphSnapshot& graph, KeyframeProposal* free_proposal,
                          EffortLevel effort) {
  // Without a place in the map the camera has no frame before this one that tells how it moves.
  const int lost_frames = std::max(loss_.lost_frames(), unplaced_ ? 1 : 0);
  FrameStep step(frame, graph, free_proposal, bounds_of(effort, options_), lost_frames);
  reference_choice_.begin_frame();
  views_.begin_frame();
  loss_.begin_frame(frame.index, frame.t_ns);
  correction_.load(frame, current_);
  step.lap(TrackerStage::kPyramid);
  const bool map_exists = motion_.reference() != kNoKeyframe || unplaced_;
  if (map_exists) follow(graph);
  step.tracked = map_exists && track(step);
  step.result.by_rays = step.tracked && needs_rays(step.result);
  if (step.tracked && new_points_.has_seeds()) observe_seeds(step);
  if (step.tracked) step.result.proposed = proposer_.due(step, tracked_view(), immature_points_);
  step.started = !step.tracked && (map_exists ? start_part(step) : start_map(step));
  step.lap(TrackerStage::kKeyframe);
  return step;
}

void Tracker::prepare_next(FrameStep& step) {
  step.resume();
  if (step.tracked && step.result.proposed) propose_keyframe(step);
  if (step.result.by_rays) new_points_.lend_rays(median_depth(step.result.T_c_ref), immature_points_);
  if (step.tracked || step.started) remember_frame(step);
  if (step.tracked) learn_fixed_pixels(step);
  if (step.tracked && !step.result.proposed && !step.result.by_depth) revisit_reference(step.graph);
  step.lap(TrackerStage::kKeyframe);
}

/// Pose of the frame relative to a reference keyframe, from the points of the map around that.
bool Tracker::track(FrameStep& step) {
  const auto asked = recognised(step);
  if (asked && search_from_recognised(*asked, step)) {
    leave_other_part(step);
    return true;
  }
  if (motion_.reference() == kNoKeyframe) {
    if (search_from_assumed(step)) return true;
    give_up_frame(LostCause::kUnplaced, step.result);
    return false;
  }
  SearchStart start{.placement = motion_.placement()};
  collect_local_map(start.placement.reference, step);
  step.lap(TrackerStage::kCandidates);
  if (search_ahead(step)) return true;
  const bool by_depth = last_.by_depth && depth_can_place(step);
  start.placement.T_c_ref = by_depth ? align_to_depth(step) : aligned_pose(step);
  step.lap(TrackerStage::kAlignment);
  LostCause cause = by_depth ? search_from(start, step) : search_from_either(start, step);
  if (place_by_both(start.placement.T_c_ref, cause, step)) return true;
  // Which way one camera turned is no better than what it found already.
  const bool may_doubt = step.bounds.doubts_poses && rig_.kind != SensorKind::kMono;
  const bool doubted = cause == LostCause::kNone && may_doubt && hardly_supported(step.result, options_);
  if (cause == LostCause::kNone && !doubted) return true;
  const auto first = doubted ? std::optional(set_aside(step)) : std::nullopt;
  if (search_widely(step)) return true;
  if (first) {  // nothing better
    collect_local_map(start.placement.reference, step);
    take_back(*first, step);
  }
  if (cause != LostCause::kNone) cause = place_by_depth_alone(cause, step);
  if (cause != LostCause::kNone) give_up_frame(cause, step.result);
  return cause == LostCause::kNone;
}

/// A newer map: take over what it confirmed, and move the reference to the newest own keyframe in it. That
/// may be of a part that the camera has left meanwhile, because it was recognised elsewhere.
void Tracker::follow(const GraphSnapshot& graph) {
  if (graph.version() == local_map_.version()) return;
  const PendingKeyframe* newest = nullptr;
  for (const PendingKeyframe& pending : immature_points_.pending()) {
    if (graph.contains(pending.id) && !graph.keyframe(pending.id).culled() &&
        in_same_part(pending.id, motion_.reference(), graph))
      newest = &pending;
  }
  if (newest != nullptr && newest->id != motion_.reference()) {
    // As it was tracked, not as the map has it now: both frames were placed by the same points.
    const SE3 T_ref_new = pose_relative_to(graph, immature_points_, motion_.reference(), newest->reference) *
                          newest->T_k_ref.inverse();
    motion_.refer_to(newest->id, T_ref_new);
  }
  immature_points_.forget_mapped(graph);
  if (graph.contains(motion_.reference()) && graph.keyframe(motion_.reference()).culled()) {
    const auto replacement = graph.live_replacement(motion_.reference());
    TWOFOLD_CHECK(replacement, "the reference was culled too long ago");
    motion_.refer_to(replacement->id, replacement->T_this_live);
  }
}

/// Dense 3D Lucas-Kanade from the last good frame (eq. 6.7), started from the motion since, then from rest.
/// @return the motion; nothing if it is not to be trusted
std::optional<SE3> Tracker::align_to_previous(const SE3& start, FrameStep& step) {
  if (last_.points.empty()) return std::nullopt;
  DenseAlignmentResult best = dense_alignment_.align(rig_.camera, last_.images.left, current_.left,
                                                     last_.points, start, step.bounds.finest_alignment_level);
  const double doubted_rms = options_.alignment.doubted_rms_share * options_.alignment.max_rms;
  if (step.bounds.align_from_rest && (!best.converged || best.rms > doubted_rms)) {
    const DenseAlignmentResult rest =
        dense_alignment_.align(rig_.camera, last_.images.left, current_.left, last_.points, SE3(),
                               step.bounds.finest_alignment_level);
    if (rest.converged && (!best.converged || rest.rms < best.rms)) best = rest;
  }
  step.result.alignment_rms = best.rms;
  const bool trusted = best.converged && best.rms < options_.alignment.max_rms;
  return trusted ? std::optional(best.T_cur_prev) : std::nullopt;
}

SE3 Tracker::aligned_pose(FrameStep& step) {
  const SE3 start = motion_.predicted_motion(step.frame.t_ns, step.after_loss());
  return align_to_previous(start, step).value_or(start) * motion_.T_c_ref();
}

/// What the next frame starts from.
void Tracker::remember_frame(const FrameStep& step) {
  const TrackResult& result = step.result;
  motion_.advance({result.reference, result.T_c_ref}, step.frame.t_ns, step.after_loss());
  correction_.advance(motion_.since_previous());
  shutter_.learn(step, search_, local_map_);
  loss_.placed();
  unplaced_ = false;
  last_.points.clear();
  for (std::size_t m = 0; m < search_.matches.size() && last_.points.size() < last_.points.capacity(); ++m) {
    if (!search_.observations[m].inlier) continue;
    const StereoPixel& z = search_.matches[m].found.pixel;
    const SE3 T_row_ref = step.shutter.seen_from(rig_, result.T_c_ref, search_.observations[m].x_ref);
    last_.points.push_back({z.head<2>().cast<float>(), T_row_ref * search_.observations[m].x_ref});
  }
  // One camera has no depth where it starts a point, and where motion began a map that was in an earlier
  // frame.
  const bool starts_points = result.proposed && rig_.kind != SensorKind::kMono && step.earlier_frames.empty();
  for (const ImmaturePoint& point : immature_points_.points()) {
    if (!starts_points || last_.points.size() == last_.points.capacity()) break;
    if (!proposer_.is_newest(point.anchor)) continue;
    const Vector3 x_c = from_inverse_depth(point.psi);
    last_.points.push_back({point.appearance.uv, step.shutter.seen_from(rig_, SE3(), x_c) * x_c});
  }
  views_.copy_corners(last_.corners);
  last_.is_keyframe = result.proposed;
  last_.by_depth = result.by_depth;
  std::swap(current_, last_.images);
  if (monocular_start_) monocular_start_->reset();
}

/// Only from a pose that most matches agree on, and that is not the elders' against the others'.
void Tracker::learn_fixed_pixels(const FrameStep& step) {
  if (step.result.by_depth) return;  // no points say how far the scene is
  samples_.clear();
  const bool agreed = step.result.inliers >= options_.fixed.min_inlier_share * step.result.matches;
  if (agreed && !pose_estimator_.mistrusts_the_young()) {
    for (const MotionObservation& observation : search_.observations) {
      if (observation.inlier) samples_.push_back(1 / (step.result.T_c_ref * observation.x_ref).z());
    }
  }
  correction_.learn(step.frame, samples_);
}

}  // namespace twofold
