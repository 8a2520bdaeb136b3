#include "engine/runners.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "base/processor_time.hpp"
#include "mapping/mapper_hook.hpp"

namespace twofold {
namespace {

/// Length of the way between two keyframes of one part, from one keyframe to the next.
double distance_travelled(const GraphSnapshot& graph, KeyframeId a, KeyframeId b) {
  const auto [first, last] = std::minmax({index(a), index(b)});
  const KeyframeId part = graph.part(b);
  double distance = 0;
  const Keyframe* before = nullptr;
  for (std::uint32_t k = first; k <= last; ++k) {
    const Keyframe& keyframe = graph.keyframe(KeyframeId{k});
    if (keyframe.culled() || keyframe.part != part) continue;
    if (before != nullptr) distance += (keyframe.T_k_w * before->T_k_w.inverse()).translation().norm();
    before = &keyframe;
  }
  return distance;
}

bool share_a_neighbour(const Keyframe& a, const Keyframe& b) {
  return std::any_of(a.edges->begin(), a.edges->end(),
                     [&](const Edge& edge) { return find_edge(b, edge.other) != nullptr; });
}

/// Of a keyframe, or of the one that stands for it, if it was culled. It must not be forgotten.
std::int64_t time_of(const GraphSnapshot& graph, KeyframeId id) {
  return graph.keyframe(graph.live_replacement(id)->id).t_ns;
}

std::int16_t narrow(int count) {
  return static_cast<std::int16_t>(std::min<int>(count, std::numeric_limits<std::int16_t>::max()));
}

CorrectionReason reason_of(MapChange::Kind kind) {
  switch (kind) {
    case MapChange::Kind::kLoopClosure:
      return CorrectionReason::kLoopClosure;
    case MapChange::Kind::kPoseGraph:
      return CorrectionReason::kPoseGraph;
    case MapChange::Kind::kPartsJoined:
      break;
  }
  return CorrectionReason::kPartsJoined;
}

/// Frames: those between see the same points with the same errors, and time is saved.
constexpr int kFocalPeriod = 4;

constexpr std::uint64_t kPatience =
    32;  // versions: a loop that the mapper dropped would be waited for for ever

}  // namespace

bool has_arrived(const GraphSnapshot& graph, const LoopConstraint& loop) {
  if (graph.version() > loop.snapshot_version + kPatience) return true;
  const auto from = graph.live_replacement(loop.from), to = graph.live_replacement(loop.to);
  if (!from || !to || from->id == to->id) return true;
  const Keyframe& a = graph.keyframe(from->id);
  const Keyframe& b = graph.keyframe(to->id);
  if (find_edge(a, b.id) != nullptr) return true;
  const bool culled = a.id != loop.from || b.id != loop.to;
  return culled && share_a_neighbour(a, b);
}

namespace {

TrackerOptions tracker_options(const EngineOptions& options) {
  TrackerOptions result = options.tracker;
  result.starts_maps = result.starts_maps && !options.localise_only;
  return result;
}

}  // namespace

TrackerRunner::TrackerRunner(const Rig& rig, const EngineOptions& options, Trace* trace)
    : tracker_(rig, tracker_options(options)),
      times_("tracker", trace),
      on_pose_(options.on_pose),
      on_frame_(options.on_frame),
      focal_sigma_(options.mapper.global.focal_sigma),
      map_sensor_(options.map ? options.map->rig.kind : rig.kind),
      can_relocalise_(options.vocabulary != nullptr),
      localise_only_(options.localise_only),
      paused_(options.mapping_paused) {
  frame_stage_ = times_.add_stage("frame");
  latency_stage_ = times_.add_stage("exposure to pose");
  listener_stage_ = times_.add_stage("pose listener");
  frame_listener_stage_ = times_.add_stage("frame listener");
  for (std::size_t s = 0; s < kTrackerStages; ++s) {
    stages_.push_back(times_.add_stage(describe(static_cast<TrackerStage>(s))));
  }
  version_counter_ = times_.add_counter("snapshot version");
  effort_counter_ = times_.add_counter("effort level");
  if (options.map) tracker_.continue_from(options.map->graph, options.assumed_pose);
  if (options.map && localise_only_ && rig.kind == SensorKind::kMono)
    focal_resection_.emplace(rig, options.tracker.local_map.max_searches, options.tracker.pose.motion);
}

void TrackerRunner::locate(const Frame& frame, const GraphSnapshot& graph, EffortLevel effort,
                           ProposalHandle& proposal, FrameRecord& record) {
  begin_ns_ = steady_now_ns();
  const TrackResult& result =
      step_.emplace(tracker_.locate(frame, graph, proposal ? &*proposal : nullptr, effort)).result;
  record.frame_index = frame.index;
  record.t_ns = frame.t_ns;
  record.state = result.status == TrackStatus::kTracking ? FrameState::kTracked : FrameState::kLost;
  record.effort = effort;
  record.cause = result.cause;
  record.snapshot_version = graph.version();
  record.reference = result.reference;
  record.T_c_ref = PackedPose(result.T_c_ref);
  for (const EarlierFrame& earlier : step_->earlier_frames) earlier_.push_back({result.reference, earlier});
  if (record.state == FrameState::kTracked) {
    record.T_c_w_causal = PackedPose(tracker_.T_c_w(*step_));
    record.part_causal = tracker_.part(*step_);
  }
  find_correction(graph, record);
  if (record.state == FrameState::kTracked) last_ = record;
  record.tracked_share = result.tracked_share();
  record.inliers = narrow(result.inliers);
  record.moving = narrow(result.moving);
  record.keyframe = result.proposed;
  record.tracking_ns = steady_now_ns() - begin_ns_;
  times_.counter(version_counter_, static_cast<std::int64_t>(graph.version()));
  times_.counter(effort_counter_, static_cast<std::int64_t>(effort));
}

void TrackerRunner::tell(std::int64_t exposed_ns, std::int64_t now_ns, FrameRecord& record) {
  record.latency_ns = now_ns - exposed_ns;
  exposed_ns_ = exposed_ns;
  times_.record(latency_stage_, exposed_ns, record.latency_ns);
  if (!on_pose_) return;
  const ScopedStage timed(times_, listener_stage_);
  on_pose_(report(record));
}

bool TrackerRunner::prepare_next(FrameRecord& record) {
  const std::int64_t resumed_ns = steady_now_ns();
  tracker_.prepare_next(*step_);
  const bool asked = focal_resection_ && record.frame_index % kFocalPeriod == 0;
  if (asked && record.state == FrameState::kTracked)
    focal_resection_->add(tracker_.last_observations(), step_->result.T_c_ref);
  record.tracking_ns += steady_now_ns() - resumed_ns;
  times_.record(frame_stage_, begin_ns_, record.tracking_ns);
  std::int64_t at_ns = begin_ns_;
  for (std::size_t s = 0; s < kTrackerStages; ++s) {
    times_.record(stages_[s], at_ns, step_->result.stage_ns[s]);
    at_ns += step_->result.stage_ns[s];
  }
  if (on_frame_) {
    const ScopedStage timed(times_, frame_listener_stage_);
    on_frame_(report(record));
  }
  return step_->result.proposed;
}

PoseReport TrackerRunner::report(const FrameRecord& record) const {
  const TrackResult& result = step_->result;
  return {record,
          step_->graph,
          correction_,
          result.information,
          exposed_ns_,
          result.stage_ns,
          tracker_.last_observations(),
          {result.T_c_ref_predicted, result.search_radius_px},
          tracker_.row_offset()};
}

/// Where the last tracked frame is in the map of this one, if that is elsewhere than it was said to be.
void TrackerRunner::find_correction(const GraphSnapshot& graph, const FrameRecord& record) {
  correction_.reason = CorrectionReason::kNone;
  if (last_.snapshot_version == graph.version() || !has_final_pose(last_, graph)) return;
  const SE3 T_c_w = final_T_c_w(last_, graph);
  const SE3 T_c_w_before = last_.T_c_w_causal.unpacked();
  const SE3 change = T_c_w * T_c_w_before.inverse();  // of the camera itself, wherever the world's origin is
  if (change.translation().norm() < kCorrection && change.so3().log().norm() < kCorrectionAngle) return;
  const MapChange& of_map = graph.last_change();
  const bool changed = of_map.version > last_.snapshot_version;
  const CorrectionReason reason = changed ? reason_of(of_map.kind) : CorrectionReason::kOptimisation;
  correction_ = {reason, record.frame_index, record.t_ns, last_.T_c_w_causal, PackedPose(T_c_w)};
  last_.snapshot_version = graph.version();  // said: a lost camera's next frames see the same map
  last_.T_c_w_causal = correction_.T_c_w_after;
}

bool TrackerRunner::wants_relocalisation() const {
  const bool lost = tracker_.unplaced() || tracker_.lost_frames() > 0;
  return can_relocalise_ && !answer_awaited_ && lost;
}

bool TrackerRunner::request_relocalisation(RelocalisationRequest& request) {
  if (!wants_relocalisation()) return false;
  request.images.copy_from(tracker_.ask_where());
  answer_awaited_ = true;
  return true;
}

void TrackerRunner::take_answer(const RelocalisationAnswer& answer) {
  answer_awaited_ = false;
  if (!answer) return;
  ++recognised_;
  tracker_.relocalise(answer->keyframe, answer->T_c_k);
}

std::string TrackerRunner::focal_note() const {
  auto found = focal_resection_ ? focal_resection_->estimate() : std::nullopt;
  if (!found || found->sigma > focal_sigma_) return "";
  found->sigma = std::hypot(found->sigma, found->scale * focal_sigma_);
  if (!found->contradicts_rig()) return "";
  // As a share: images may have been resampled for the map, and its pixels are not the camera's then.
  return fmt::format("the map shows a focal length {:.1f} +- {:.1f} % {} than the calibration says{}",
                     100 * std::abs(found->scale - 1), 100 * found->sigma,
                     found->scale < 1 ? "shorter" : "longer",
                     map_sensor_ == SensorKind::kMono ? ", or that of the map's own camera is wrong" : "");
}

void TrackerRunner::place_earlier_frames(RecordSequence<FrameRecord>& frames, FrameCounts& counts) const {
  std::size_t at = 0;  // both are in the order of the source
  for (const PlacedFrame& placed : earlier_) {
    while (at < frames.size() && frames[at].frame_index < placed.frame.frame_index) ++at;
    if (at == frames.size()) return;
    FrameRecord& record = frames[at];
    if (record.frame_index != placed.frame.frame_index || record.state != FrameState::kLost) continue;
    record.state = FrameState::kPlacedLater;
    --counts.lost;
    ++counts.placed_later;
    record.reference = placed.reference;
    record.T_c_ref = PackedPose(placed.frame.T_c_first);
  }
}

MapperRunner::MapperRunner(const Rig& rig, const EngineOptions& options, Trace* trace)
    : mapper_(rig, options.mapper),
      on_next_map_(options.on_next_map),
      on_map_(options.on_map),
      may_change_(!options.localise_only),
      times_("mapper", trace) {
  round_stage_ = times_.add_stage("round");
  listener_stage_ = times_.add_stage("map listener");
  publish_stage_ = times_.add_stage("publish");
  release_stage_ = times_.add_stage("release");
  if (options.map) mapper_.continue_from(options.map->graph);
  if (options.map) map_note_ = rig_note(rig, options.map->rig);
  tell_of_next_map();
}

std::uint64_t MapperRunner::step(std::span<const ProposalHandle> proposals,
                                 std::span<const LoopMessage> messages) {
  do_round(proposals, messages);
  tell_of_next_map();
  return mapper_.graph().version();
}

void MapperRunner::do_round(std::span<const ProposalHandle> proposals,
                            std::span<const LoopMessage> messages) {
  const ScopedStage timed(times_, round_stage_);
  proposals_.clear();
  for (const ProposalHandle& proposal : proposals) proposals_.push_back(&*proposal);
  loops_.clear();
  for (const LoopMessage& message : messages) {
    if (const auto* loop = std::get_if<LoopConstraint>(&message)) {
      loops_.push_back(*loop);
    } else if (const auto* similarities = std::get_if<SimilarityUpdate>(&message)) {
      replacement_log_.add_scaling(mapper_.graph().version(), mapper_.take_similarities(*similarities));
    } else {
      (void)mapper_.take_pose_graph(std::get<PoseGraphUpdate>(message));
    }
  }
  const MapperReport report = mapper_.step(proposals_, loops_);
  for (const KeyframeId culled : report.culled_keyframes) replacement_log_.add(culled, mapper_.graph());
  ++totals_.rounds;
  totals_.metric_loops += report.metric_loops;
  totals_.loops += report.loops;
  totals_.late_loops += report.late_loops;
}

void MapperRunner::tell_of_next_map() {
  if (!on_next_map_) return;
  const ScopedStage timed(times_, listener_stage_);
  on_next_map_(mapper_.graph(), mapper_.window());
}

GraphSnapshot MapperRunner::publish() {
  GraphSnapshot graph = mapper_.publish();
  if (on_map_) on_map_(graph, mapper_.window());
  return graph;
}

GraphSnapshot MapperRunner::finish() {
  if (may_change_) {
    mapper_.optimise_all_poses();
    const GlobalAdjustmentReport report = mapper_.adjust_all();
    totals_.globally_adjusted_keyframes = report.keyframes;
    totals_.focal_length = report.focal_length;
  }
  tell_of_next_map();
  return publish();
}

LoopCloserRunner::LoopCloserRunner(const Rig& rig, const EngineOptions& options, Trace* trace)
    : rig_(rig),
      mapper_options_(options.mapper),
      on_places_(options.on_places),
      on_loop_(options.on_loop),
      times_("loop closer", trace) {
  place_stage_ = times_.add_stage("place");
  place_cpu_stage_ = times_.add_stage("place cpu");
  pose_graph_stage_ = times_.add_stage("pose graph");
  relocalise_stage_ = times_.add_stage("relocalisation");
  if (options.vocabulary) closer_.emplace(rig, options.vocabulary, options.loop_closer);
  if (closer_ && options.map) {
    const Rig& map_rig = options.map->rig;
    const bool same_pixels = rig_difference(rig, map_rig).empty() && rig_note(rig, map_rig).empty();
    closer_->continue_from(same_pixels ? options.map->places : places_seen_by(rig, *options.map));
  }
  if (closer_ && on_places_) on_places_(closer_->places());
}

std::span<LoopMessage> LoopCloserRunner::step(const KeyframeProposal& keyframe, const GraphSnapshot& graph) {
  messages_.clear();
  found_.reset();
  if (!closer_) return messages_;
  optimise_if_due(graph);
  const ScopedStage timed(times_, place_stage_);
  const std::int64_t begin_ns = steady_now_ns();
  const std::int64_t cpu_begin_ns = thread_cpu_ns();
  const auto loop = closer_->step(keyframe, graph);
  times_.record(place_cpu_stage_, begin_ns, thread_cpu_ns() - cpu_begin_ns);
  if (loop && !awaits_similarities(graph)) {
    const bool drifts = scale_drifts(rig_, mapper_options_);
    if (drifts) messages_.emplace_back(close_over_sim3(graph, *loop, rig_, mapper_options_));
    messages_.emplace_back(*loop);
    const bool joins = graph.part(loop->from) != graph.part(loop->to);
    found_ = ClosedLoop{
        *loop, graph.T_k_w(loop->to) * graph.T_k_w(loop->from).inverse(),   keyframe.t_ns,
        joins, joins ? 0 : distance_travelled(graph, loop->from, loop->to), time_of(graph, loop->from)};
    (drifts ? awaited_ : not_optimised_) = loop;
  }
  if (on_places_) on_places_(closer_->places());
  return messages_;
}

void LoopCloserRunner::sending(std::size_t count) {
  if (!found_ || count < messages_.size()) return;
  loops_.push_back(*found_);
  if (on_loop_) on_loop_(loops_.back());
}

RelocalisationAnswer LoopCloserRunner::relocalise(const RelocalisationRequest& request,
                                                  const GraphSnapshot& graph) {
  const ScopedStage timed(times_, relocalise_stage_);
  return closer_ ? closer_->relocalise(request.images, graph) : std::nullopt;
}

bool LoopCloserRunner::awaits_similarities(const GraphSnapshot& graph) {
  if (awaited_ && has_arrived(graph, *awaited_)) awaited_.reset();
  return awaited_.has_value();
}

/// One pose graph optimisation for a run of loops: when the newest of them is in the map.
void LoopCloserRunner::optimise_if_due(const GraphSnapshot& graph) {
  if (!not_optimised_ || graph.version() == not_optimised_->snapshot_version) return;
  if (!has_arrived(graph, *not_optimised_)) return;
  const ScopedStage timed(times_, pose_graph_stage_);
  PoseGraphReport report;
  messages_.emplace_back(optimise_component(graph, graph.reference(), rig_, mapper_options_, report));
  not_optimised_.reset();
}

void collect_results(TrackerRunner& tracking, MapperRunner& mapping, LoopCloserRunner& loop_closing,
                     RunResult& result) {
  result.graph = mapping.finish();
  tracking.place_earlier_frames(result.frames, result.counts);
  mapping.replacement_log().hang_on_live_keyframes(result.frames);
  for (std::string note : {mapping.map_note(), tracking.focal_note()}) {
    if (!note.empty()) result.notes.push_back(std::move(note));
  }
  result.row_offset = tracking.row_offset();
  result.recognised = tracking.recognised();
  result.mapping = mapping.totals();
  result.places = loop_closing.places();
  result.readout = tracking.readout();
  result.times.push_back(std::move(tracking.times()));
  result.times.push_back(std::move(mapping.times()));
  result.times.push_back(std::move(loop_closing.times()));
  result.loops = std::move(loop_closing.loops());
}

}  // namespace twofold
