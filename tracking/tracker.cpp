#include "tracking/tracker.hpp"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <utility>

#include "geometry/inverse_depth.hpp"
#include "imaging/image_buffers.hpp"

namespace twofold {
namespace {

constexpr std::size_t kMaxCandidates = 3000;
constexpr std::size_t kMaxImmaturePoints = 1200;
constexpr std::size_t kMaxPending = 12;
constexpr std::size_t kMaxAlignmentPoints = 240;
constexpr int kHintRounds = 3;

}  // namespace

/// Attributes the time since the last lap to a stage.
class Tracker::StageClock {
 public:
  explicit StageClock(TrackResult& result) : result_(result) {}
  void lap(TrackerStage stage) {
    const auto now = std::chrono::steady_clock::now();
    result_.stage_ns[static_cast<std::size_t>(stage)] += (now - last_).count();
    last_ = now;
  }

 private:
  TrackResult& result_;
  std::chrono::steady_clock::time_point last_ = std::chrono::steady_clock::now();
};

Tracker::Tracker(const Rig& rig, const TrackerOptions& options)
    : rig_(rig),
      options_(options),
      alignment_(kMaxAlignmentPoints, options.alignment),
      local_map_(kMaxCandidates),
      quadtree_(rig.camera.width, rig.camera.height, kMaxCandidates),
      immature_points_(kMaxImmaturePoints, kMaxPending),
      starter_(rig, options) {
  const auto searches = static_cast<std::size_t>(options.max_searches);
  matches_.reserve(searches);
  motion_.reserve(searches);
  inlier_ids_.reserve(searches);
  depths_.reserve(std::max(searches, kMaxImmaturePoints));
  previous_points_.reserve(kMaxAlignmentPoints);
  allocate_images(rig, current_);
  allocate_images(rig, previous_);
}

TrackResult Tracker::step(const Frame& frame, const GraphSnapshot& graph, KeyframeProposal* free_proposal,
                          EffortLevel effort) {
  bounds_ = bounds_of(effort, options_);
  TrackResult result;
  StageClock clock(result);
  ++frames_;
  const LostCause gap = intervals_.next(frame.index, frame.t_ns);
  if (lost_frames_ == 0) gap_before_loss_ = gap;
  load_images(frame);
  clock.lap(TrackerStage::kPyramid);
  if (reference_ == kNoKeyframe && !unplaced_) {
    if (start_map(frame, free_proposal, result)) remember_frame(SE3());
    clock.lap(TrackerStage::kKeyframe);
    return result;
  }
  adopt(graph);
  const KeyframeId reference_before = reference_;
  const SE3 T_prev_ref_before = T_prev_ref_;
  const bool hinted = take_hint(graph);
  if (reference_ == kNoKeyframe) {
    give_up_frame(LostCause::kUnplaced, result);
  } else if (track(graph, hinted, clock, result)) {
    if (free_proposal != nullptr && keyframe_due(result, result.T_c_ref)) {
      propose_keyframe(frame, graph, *free_proposal, result);
    }
    remember_frame(result.T_c_ref);
    if (!result.proposed) revisit_reference(graph);
    clock.lap(TrackerStage::kKeyframe);
    return result;
  } else if (hinted) {  // it was not that place: the images to try from are still those of the last good
                        // frame
    reference_ = reference_before;
    T_prev_ref_ = T_prev_ref_before;
    local_map_stale_ = true;
  }
  if (new_part_due(frame.t_ns) && start_part(frame, free_proposal, result)) remember_frame(SE3());
  clock.lap(TrackerStage::kKeyframe);
  return result;
}

/// Pose of the frame relative to the reference keyframe, from the points of the map around it.
bool Tracker::track(const GraphSnapshot& graph, bool hinted, StageClock& clock, TrackResult& result) {
  if (local_map_stale_) local_map_.rebuild(graph, reference_, immature_points_, options_.neighbour_keyframes);
  local_map_stale_ = false;
  clock.lap(TrackerStage::kCandidates);
  SE3 T_c_ref_start = hinted ? T_prev_ref_ : align_to_previous(result);
  clock.lap(TrackerStage::kAlignment);
  // A hint is the place of an earlier frame: far points are found from there, and lead to where near ones
  // are.
  bool tracked = true;
  for (int round = 0; tracked && round < (hinted ? kHintRounds : 1); ++round) {
    select_candidates(T_c_ref_start, result);
    clock.lap(TrackerStage::kCandidates);
    search_points(T_c_ref_start, result);
    clock.lap(TrackerStage::kSearch);
    tracked = estimate_pose(T_c_ref_start, result);
    T_c_ref_start = result.T_c_ref;
    clock.lap(TrackerStage::kMotion);
  }
  if (tracked) unplaced_ = false;
  return tracked;
}

void Tracker::load_images(const Frame& frame) {
  current_.left.build(frame.left);
  if (rig_.kind == SensorKind::kStereo) current_.right.build(frame.right);
  if (rig_.kind == SensorKind::kRgbd) frame.depth.copyTo(current_.depth);
}

/// A newer map: take over what it confirmed, and move the reference to the newest own keyframe in it.
void Tracker::adopt(const GraphSnapshot& graph) {
  if (graph.version() == graph_version_) return;
  graph_version_ = graph.version();
  local_map_stale_ = true;
  const PendingKeyframe* newest = nullptr;
  for (const PendingKeyframe& pending : immature_points_.pending()) {
    if (graph.contains(pending.id) && !graph.keyframe(pending.id).culled()) newest = &pending;
  }
  if (newest != nullptr && newest->id != reference_) {
    // As it was tracked, not as the map has it now: both frames were placed by the same points.
    const SE3 T_ref_new =
        relative_pose(graph, immature_points_, reference_, newest->reference) * newest->T_k_ref.inverse();
    T_prev_ref_ = T_prev_ref_ * T_ref_new;
    reference_ = newest->id;
  }
  immature_points_.adopt(graph);
  if (graph.contains(reference_) && graph.keyframe(reference_).culled()) {
    const auto replacement = graph.live_replacement(reference_);
    TWOFOLD_CHECK(replacement, "the reference was culled too long ago");
    T_prev_ref_ = T_prev_ref_ * replacement->T_this_live;
    reference_ = replacement->id;
  }
}

/// Dense 3D Lucas-Kanade from the last good frame (eq. 6.7), started from constant velocity, then from rest.
SE3 Tracker::align_to_previous(TrackResult& result) {
  const SE3 start = lost_frames_ > 0 ? SE3() : T_cur_prev_;
  if (previous_points_.empty()) return start * T_prev_ref_;
  DenseAlignmentResult best = alignment_.align(rig_.camera, previous_.left, current_.left, previous_points_,
                                               start, bounds_.finest_alignment_level);
  if (bounds_.align_from_rest && (!best.converged || best.rms > 0.5 * options_.max_alignment_rms)) {
    const DenseAlignmentResult rest = alignment_.align(
        rig_.camera, previous_.left, current_.left, previous_points_, SE3(), bounds_.finest_alignment_level);
    if (rest.converged && (!best.converged || rest.rms < best.rms)) best = rest;
  }
  result.alignment_rms = best.rms;
  const bool trusted = best.converged && best.rms < options_.max_alignment_rms;
  return (trusted ? best.T_cur_prev : start) * T_prev_ref_;
}

void Tracker::remember_frame(const SE3& T_c_ref) {
  T_cur_prev_ = lost_frames_ > 0 || frames_ < 2 ? SE3() : T_c_ref * T_prev_ref_.inverse();
  T_prev_ref_ = T_c_ref;
  lost_frames_ = 0;
  seeing_since_ns_ = 0;
  previous_points_.clear();
  for (std::size_t m = 0; m < matches_.size() && previous_points_.size() < previous_points_.capacity(); ++m) {
    if (!motion_[m].inlier) continue;
    previous_points_.push_back({matches_[m].found.z.head<2>().cast<float>(), T_c_ref * motion_[m].x_ref});
  }
  for (const ImmaturePoint& point : immature_points_.points()) {
    if (previous_points_.size() == previous_points_.capacity()) break;
    if (index(point.anchor) + 1 != next_keyframe_ || !local_map_stale_)
      continue;  // started in this very frame
    previous_points_.push_back({point.appearance.uv, from_inverse_depth(point.psi)});
  }
  std::swap(current_, previous_);
}

}  // namespace twofold
