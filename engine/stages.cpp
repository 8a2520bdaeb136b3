#include "engine/stages.hpp"

namespace twofold {

TrackingStage::TrackingStage(const Rig& rig, const TrackerOptions& options, Trace* trace)
    : tracker_(rig, options), times_("tracker", trace) {
  frame_stage_ = times_.add_stage("frame");
  latency_stage_ = times_.add_stage("latency from due time");
  for (std::size_t s = 0; s < kTrackStages; ++s) {
    stages_.push_back(times_.add_stage(describe(static_cast<TrackStage>(s))));
  }
  version_counter_ = times_.add_counter("snapshot version");
}

bool TrackingStage::step(const Frame& frame, const GraphSnapshot& graph, ProposalHandle& proposal,
                         FrameRecord& record) {
  const std::int64_t begin_ns = steady_now_ns();
  const TrackResult result = tracker_.step(frame, graph, proposal ? &*proposal : nullptr);
  record.frame_index = frame.index;
  record.t_ns = frame.t_ns;
  record.state = result.status == TrackStatus::kTracking ? FrameState::kTracked : FrameState::kLost;
  record.cause = describe(result.cause);
  record.reference = result.reference;
  record.T_c_ref = result.T_c_ref;
  record.T_c_w_causal = record.state == FrameState::kTracked ? tracker_.T_c_w(graph) : SE3();
  record.tracked_share = result.tracked_share();
  record.inliers = result.inliers;
  record.snapshot_version = graph.version();
  record.keyframe = result.proposed;
  record.tracking_ns = steady_now_ns() - begin_ns;
  times_.record(frame_stage_, begin_ns, record.tracking_ns);
  std::int64_t at_ns = begin_ns;
  for (std::size_t s = 0; s < kTrackStages; ++s) {
    times_.record(stages_[s], at_ns, result.stage_ns[s]);
    at_ns += result.stage_ns[s];
  }
  times_.counter(version_counter_, static_cast<std::int64_t>(graph.version()));
  return result.proposed;
}

void TrackingStage::proposal_rejected(FrameRecord& record) {
  tracker_.proposal_rejected();
  record.keyframe = false;
}

void TrackingStage::finish(std::int64_t scheduled_ns, FrameRecord& record) {
  record.latency_ns = steady_now_ns() - scheduled_ns;
  times_.record(latency_stage_, scheduled_ns, record.latency_ns);
}

MappingStage::MappingStage(const Rig& rig, const MapperOptions& options, Trace* trace)
    : mapper_(rig, options), times_("mapper", trace) {
  round_stage_ = times_.add_stage("round");
}

MapperRound MappingStage::step(std::span<const ProposalHandle> proposals) {
  const std::int64_t begin_ns = steady_now_ns();
  proposals_.clear();
  for (const ProposalHandle& proposal : proposals) proposals_.push_back(&*proposal);
  const MapperReport report = mapper_.step(proposals_);
  MapperRound round;
  round.version = mapper_.graph().version();
  round.proposals = static_cast<int>(proposals.size());
  round.inner_window = report.inner_window;
  round.outer_window = report.outer_window;
  round.points = report.points;
  round.observations = report.observations;
  round.metric_loops = report.metric_loops;
  round.duration_ns = steady_now_ns() - begin_ns;
  times_.record(round_stage_, begin_ns, round.duration_ns);
  return round;
}

}  // namespace twofold
