#include "slam/pose_reporter.hpp"

#include <Eigen/Cholesky>

#include "engine/listeners.hpp"
#include "slam/conversions.hpp"

namespace twofold {
namespace {

MapEventKind kind_of(CorrectionReason reason) {
  switch (reason) {
    case CorrectionReason::kLoopClosure:
      return MapEventKind::kLoopClosure;
    case CorrectionReason::kPoseGraph:
      return MapEventKind::kPoseGraph;
    case CorrectionReason::kPartsJoined:
      return MapEventKind::kPartsJoined;
    case CorrectionReason::kOptimisation:
    case CorrectionReason::kNone:
      break;
  }
  return MapEventKind::kOptimisation;
}

TrackingState state_of(const FrameRecord& record) {
  if (record.state == FrameState::kTracked) return TrackingState::kTracked;
  return record.cause == LostCause::kUnplaced ? TrackingState::kUnplaced : TrackingState::kLost;
}

/// The first frame of a map part is that part's world: it is its own reference, and nothing was measured.
bool defines_world(const PoseReport& report) {
  const FrameRecord& record = report.record;
  return record.reference == record.part_causal && report.information.isZero(0) &&
         record.T_c_ref.unpacked().log().isZero(0);
}

/// J^T W J is of delta in T_c_w <- exp(delta) T_c_w; for T_w_c the same delta stands on the right, negative,
/// which a covariance does not show.
void find_covariance(const PoseReport& report, PoseEstimate& now) {
  Eigen::Map<Matrix6> covariance(now.covariance.data());  // symmetric: either order
  now.covariance_known = defines_world(report);
  if (now.covariance_known) {
    covariance.setZero();
    return;
  }
  const Eigen::LDLT<Matrix6> factor(report.information);
  if (factor.info() != Eigen::Success || !(factor.vectorD().minCoeff() > 0)) return;
  covariance = factor.solve(Matrix6::Identity());
  now.covariance_known = true;
}

MapEvent event_of(MapEventKind kind, const PoseEstimate& now) {
  MapEvent event;
  event.kind = kind;
  event.frame = now.frame;
  event.t_ns = now.t_ns;
  event.map_version = now.map_version;
  event.keyframe = now.reference_keyframe;
  event.map_part = now.map_part;
  return event;
}

void set_poses(const SE3& T_w_before, const SE3& T_w_after, MapEvent& event) {
  event.T_world_camera_before = to_pose(T_w_before);
  event.T_world_camera_after = to_pose(T_w_after);
  if (event.map_part_before != event.map_part) return;
  event.moved = (T_w_after.translation() - T_w_before.translation()).norm();
  event.turned = (T_w_before.so3().inverse() * T_w_after.so3()).log().norm();
}

void set_movement(const MapMovement& movement, MapEvent& event) {
  event.keyframes_moved = movement.keyframes;
  event.farthest_moved = movement.farthest;
  event.most_turned = movement.most_turned;
  if (event.kind == MapEventKind::kOptimisation) return;
  event.loop_from = index(movement.loop_from);
  event.loop_to = index(movement.loop_to);
}

}  // namespace

void PoseReporter::listen(EngineOptions& options) {
  options.on_next_map =
      both(options.on_next_map, MapListener([this](const GraphSnapshot& graph, const DoubleWindow& window) {
             movements_.made(graph, window);
           }));
  options.on_loop =
      both(options.on_loop, LoopListener([this](const ClosedLoop& loop) { movements_.found(loop); }));
}

PoseEstimate PoseReporter::next(const PoseReport& report, Events& events) {
  const FrameRecord& record = report.record;
  PoseEstimate now;
  now.frame = record.frame_index;
  now.t_ns = record.t_ns;
  now.state = state_of(record);
  now.keyframe = record.keyframe;
  now.effort = static_cast<std::uint8_t>(record.effort);
  now.reason = describe(record.cause);
  now.points = record.inliers;
  now.tracked_share = record.tracked_share;
  now.map_version = record.snapshot_version;
  now.exposed_ns = report.exposed_ns;
  now.latency_ns = record.latency_ns;
  if (record.state == FrameState::kTracked) {
    const SE3 T_c_w = record.T_c_w_causal.unpacked();
    now.T_world_camera = to_pose(T_c_w.inverse());
    now.map_part = index(record.part_causal);
    now.reference_keyframe = index(record.reference);
    now.T_reference_camera = to_pose(record.T_c_ref.unpacked().inverse());
    find_covariance(report, now);
    if (const auto T_last_w = last_T_c_w(report)) {
      const SE3 T_last_c = *T_last_w * T_c_w.inverse();
      const double dt = static_cast<double>(record.t_ns - last_.t_ns) * 1e-9;
      Eigen::Map<Vector6>(now.velocity.data()) = T_last_c.log() / dt;
      T_odom_c_ = T_odom_c_ * T_last_c;
    }
    now.T_odom_camera = to_pose(T_odom_c_);
  }
  find_events(report, now, events);
  if (record.state == FrameState::kTracked) last_ = record;
  was_lost_ = record.state != FrameState::kTracked;
  return now;
}

std::optional<SE3> PoseReporter::last_T_c_w(const PoseReport& report) const {
  if (last_.state != FrameState::kTracked) return std::nullopt;
  const GraphSnapshot& graph = report.graph;
  const bool known = has_final_pose(last_, graph);
  const KeyframeId part = known ? graph.part(last_.reference) : last_.part_causal;
  if (part != report.record.part_causal) return std::nullopt;
  return known ? final_T_c_w(last_, graph) : last_.T_c_w_causal.unpacked();
}

/// The camera stays where it is, but its world has more in it, or what was there has moved.
void PoseReporter::tell_joined(const PoseReport& report, const MapMovement& movement, const PoseEstimate& now,
                               Events& events) const {
  MapEvent& event = events.correction.emplace(event_of(MapEventKind::kPartsJoined, now));
  event.map_part_before = event.map_part;
  const SE3 T_w_c = last_T_c_w(report).value_or(report.record.T_c_w_causal.unpacked()).inverse();
  set_poses(T_w_c, T_w_c, event);
  set_movement(movement, event);
}

void PoseReporter::find_events(const PoseReport& report, const PoseEstimate& now, Events& events) {
  if (report.correction.reason != CorrectionReason::kNone) {
    MapEvent& event = events.correction.emplace(event_of(kind_of(report.correction.reason), now));
    event.map_part_before = index(last_.part_causal);
    if (event.map_part == kNoId) event.map_part = index(report.graph.part(last_.reference));
    set_poses(report.correction.T_c_w_before.unpacked().inverse(),
              report.correction.T_c_w_after.unpacked().inverse(), event);
    set_movement(movements_.take(report.record.snapshot_version), event);
    last_.T_c_w_causal = report.correction.T_c_w_after;
    last_.part_causal = report.graph.part(last_.reference);
  } else if (now.state == TrackingState::kTracked) {
    const MapMovement movement = movements_.take(report.record.snapshot_version);
    if (movement.joined > 0)
      tell_joined(report, movement, now, events);  // others are too small to be told of
  }
  if (now.state != TrackingState::kTracked || !was_lost_) return;
  // The tracker has started a part whose first keyframe the mapper has not seen yet.
  const bool known = last_.state == FrameState::kTracked && last_.part_causal == report.record.part_causal;
  const bool new_part = !known && !report.graph.contains(report.record.part_causal);
  const bool first_map = new_part && report.graph.keyframe_count() == 0;
  if (first_map) return;
  MapEvent& event = events.placing.emplace(
      event_of(new_part ? MapEventKind::kNewPart : MapEventKind::kRelocalisation, now));
  const SE3 T_w_now = to_se3(now.T_world_camera);
  SE3 T_w_last = T_w_now;
  if (last_.state == FrameState::kTracked) {
    event.map_part_before = index(last_.part_causal);
    T_w_last = last_T_c_w(report).value_or(last_.T_c_w_causal.unpacked()).inverse();
  }
  set_poses(T_w_last, T_w_now, event);
}

}  // namespace twofold
