#include "apps/twofold/run_summary.hpp"

#include <algorithm>
#include <array>
#include <cmath>

#include "apps/twofold/graph_export.hpp"
#include "apps/twofold/loop_latency.hpp"
#include "apps/twofold/map_options.hpp"
#include "apps/twofold/recoveries.hpp"
#include "io/sources/source_path.hpp"

namespace twofold {
namespace {

using Json = nlohmann::ordered_json;

/// A frame counts as late in the report when its pose was known later than this after its exposure: when the
/// next one was exposed, at the pace of the run, or at that of the recording if the run kept none.
std::int64_t late_ns(const PacingOptions& pacing, const RunResult& result) {
  UsualInterval interval;
  for (const FrameRecord& record : result.frames) interval.add(record.t_ns);
  const double speed = pacing.live || pacing.speed == 0 ? 1 : pacing.speed;
  return std::llround(static_cast<double>(interval.ns()) / speed);
}

/// Of a run that kept a pace; nothing otherwise, because nothing says when its frames were exposed.
Json exposure_to_pose_json(const PacingOptions& pacing, const RunResult& result) {
  if (!pacing.keeps_pace()) return nullptr;
  const LatencyHistogram latency = exposure_to_pose(result);
  const auto ms = [](std::int64_t ns) { return static_cast<double>(ns) * 1e-6; };
  return {{"p50_ms", ms(latency.quantile_ns(0.5))},
          {"p99_ms", ms(latency.quantile_ns(0.99))},
          {"max_ms", ms(latency.max_ns())}};
}

Json parts_json(const std::vector<MapPart>& parts) {
  Json json = Json::array();
  for (const MapPart& part : parts) {
    json.push_back({{"first_keyframe", index(part.id)},
                    {"keyframes", part.keyframes},
                    {"frames", part.trajectory.size()}});
  }
  return json;
}

Json late_and_lost(const PacingOptions& pacing, const RunResult& result) {
  const std::int64_t period_ns = late_ns(pacing, result);
  Json lost = Json::array();
  Json late = Json::array();
  std::int64_t previous_t_ns = 0;
  for (const FrameRecord& record : result.frames) {
    const double gap_ms = previous_t_ns == 0 ? 0 : static_cast<double>(record.t_ns - previous_t_ns) * 1e-6;
    previous_t_ns = record.t_ns;
    if (record.state == FrameState::kLost) {
      lost.push_back(
          {{"frame", record.frame_index}, {"cause", describe(record.cause)}, {"ms_since_previous", gap_ms}});
    } else if (record.state == FrameState::kDropped) {
      late.push_back({{"frame", record.frame_index},
                      {"effort level", describe(record.effort)},
                      {"cause", "dropped: its successor was there already"}});
    } else if (record.latency_ns > period_ns) {
      const bool own = record.tracking_ns > period_ns / 2;
      late.push_back(
          {{"frame", record.frame_index},
           {"latency_ms", static_cast<double>(record.latency_ns) * 1e-6},
           {"effort level", describe(record.effort)},
           {"tracking_ms", static_cast<double>(record.tracking_ns) * 1e-6},
           {"cause", own ? "tracking it took long" : "it waited: earlier frames, decoding, or no CPU"}});
    }
  }
  return {{"why_lost", lost}, {"why_late", late}};
}

Json loops_json(const EngineOptions& options, const RunResult& result) {
  Json loops = Json::array();
  for (const ClosedLoop& loop : result.loops) {
    const SE3 drift = loop.drift();
    const Json travelled = loop.joins_parts ? Json() : Json(loop.travelled);
    loops.push_back({{"t_ns", loop.t_ns},
                     {"from", index(loop.constraint.from)},
                     {"from_t_ns", loop.from_t_ns},
                     {"from_loaded", index(loop.constraint.from) < loaded_keyframe_ids(options)},
                     {"to", index(loop.constraint.to)},
                     {"inliers", loop.constraint.inliers},
                     {"scale", loop.constraint.scale},
                     {"joins_parts", loop.joins_parts},
                     {"drift_m", loop.joins_parts ? Json() : Json(drift.translation().norm())},
                     {"drift_rad", loop.joins_parts ? Json() : Json(drift.so3().log().norm())},
                     {"travelled_m", travelled}});
  }
  return loops;
}

/// How far the camera jumped in the map, when, and why.
Json corrections_json(const RunResult& result) {
  Json corrections = Json::array();
  for (const PoseCorrection& c : result.corrections) {
    const SE3 T_before_after = c.T_c_w_before.unpacked() * c.T_c_w_after.unpacked().inverse();
    corrections.push_back({{"frame", c.frame_index},
                           {"t_ns", c.t_ns},
                           {"reason", describe(c.reason)},
                           {"moved_m", T_before_after.translation().norm()},
                           {"turned_rad", T_before_after.so3().log().norm()}});
  }
  return corrections;
}

/// Where the lost camera was placed again; null where there is no way between the two places.
Json relocalisations_json(const EngineOptions& options, const RunResult& result) {
  Json json = Json::array();
  for (const Recovery& r : recoveries(result, loaded_keyframe_ids(options))) {
    json.push_back({{"frame", r.frame},
                    {"t_ns", r.t_ns},
                    {"lost_frames", r.lost_frames},
                    {"new_part", r.new_part},
                    {"moved_m", r.T_last_now ? Json(r.T_last_now->translation().norm()) : Json()},
                    {"turned_rad", r.T_last_now ? Json(r.T_last_now->so3().log().norm()) : Json()}});
  }
  return json;
}

/// What became of the map the run started with.
Json loaded_map_json(const EngineOptions& options, const RunResult& result) {
  if (!options.map) return nullptr;
  Json json{{"keyframes", live_keyframes(options.map->graph)},
            {"localise_only", options.localise_only},
            {"recognised", false}};
  if (const auto frame = recognised_at(options, result)) {
    json["recognised"] = true;
    json["recognised_at_frame"] = *frame;
  }
  return json;
}

Json checkpoints_json(const CheckpointReport& report) {
  return {{"saved", report.saved},
          {"longest_ms", static_cast<double>(report.longest_ns) * 1e-6},
          {"error", report.error}};
}

/// Frames on each effort level, and where it was changed.
Json effort_json(const RunResult& result) {
  std::array<std::int64_t, kEffortLevels> frames{};
  Json changes = Json::array();
  EffortLevel effort = EffortLevel::kEverything;
  for (const FrameRecord& record : result.frames) {
    ++frames[static_cast<std::size_t>(record.effort)];
    if (record.effort != effort) {
      changes.push_back({{"frame", record.frame_index}, {"effort level", describe(record.effort)}});
    }
    effort = record.effort;
  }
  Json on = Json::object();
  for (std::size_t r = 0; r < frames.size(); ++r) on[describe(static_cast<EffortLevel>(r))] = frames[r];
  return {{"frames", on}, {"changes", changes}};
}

/// Of the points found in a frame, those that move themselves.
Json moving_points_json(const RunResult& result) {
  constexpr int kSomebody = 5;  // fewer are mistakes of the search
  int most = 0;
  std::int64_t frames = 0;
  for (const FrameRecord& record : result.frames) {
    most = std::max<int>(most, record.moving);
    frames += record.moving >= kSomebody ? 1 : 0;
  }
  return {{"frames", frames}, {"most_in_a_frame", most}};
}

/// Null if the calibration gives it.
Json readout_json(const std::optional<ReadoutEstimate>& readout) {
  if (!readout) return nullptr;
  const bool measured = readout->pairs > 1;
  return {{"found", readout->significant},
          {"readout_ms", measured ? Json(1e3 * readout->seconds) : Json(nullptr)},
          {"sigma_ms", measured ? Json(1e3 * readout->sigma) : Json(nullptr)},
          {"pairs", readout->pairs}};
}

}  // namespace

Json summary_json(const std::string& source_text, const EngineOptions& options, const RunResult& result,
                  const std::vector<MapPart>& parts) {
  std::size_t points = 0;
  for (std::uint32_t p = 0; p < result.graph.point_count(); ++p)
    points += !result.graph.point(PointId{p}).culled();
  const double frames = std::max<double>(1, static_cast<double>(result.frames.size()));
  Json json{{"source", absolute_source(source_text)},
            {"interrupted", result.interrupted},
            {"error", result.error},
            {"errors", Json::array()},
            {"frames", result.frames.size()},
            {"tracked", result.counts.tracked},
            {"placed_later", result.counts.placed_later},
            {"lost", result.counts.lost},
            {"dropped", result.counts.dropped},
            {"keyframes", live_keyframes(result.graph)},
            {"points", points},
            {"loaded_map", loaded_map_json(options, result)},
            {"checkpoints", checkpoints_json(result.checkpoints)},
            {"map_parts", parts_json(parts)},
            {"moving_points", moving_points_json(result)},
            {"row_offset_px", result.row_offset},
            {"rolling_shutter", readout_json(result.readout)},
            {"mapper_rounds", result.mapping.rounds},
            {"metric_loop_edges", result.mapping.metric_loops},
            {"closed_loops", loops_json(options, result)},
            {"loops_too_late", result.mapping.late_loops},
            {"globally_adjusted_keyframes", result.mapping.globally_adjusted_keyframes},
            {"pose_corrections", corrections_json(result)},
            {"relocalisations", relocalisations_json(options, result)},
            {"wall_seconds", result.wall_seconds},
            {"cpu_seconds", result.cpu_seconds},
            {"exposure_to_pose", exposure_to_pose_json(options.pacing, result)},
            {"cpu_ms_per_frame", 1e3 * result.cpu_seconds / frames},
            {"peak_rss_mb", result.peak_rss_mb},
            {"options",
             {{"deterministic", options.deterministic},
              {"live", options.pacing.live},
              {"speed", options.pacing.speed},
              {"inner_window", options.mapper.inner_window},
              {"outer_window", options.mapper.outer_window},
              {"min_covisible", options.mapper.min_covisible},
              {"wanted_matches", options.tracker.local_map.wanted_matches}}},
            {"notes", result.notes}};
  json.update(late_and_lost(options.pacing, result));
  return json;
}

Json timing_json(const RunResult& result) {
  Json json;
  json["effort levels"] = effort_json(result);
  for (const StageRecorder& recorder : result.times) json[recorder.thread_name()] = recorder.to_json();
  const LoopLatency latency = loop_latency(result);
  json["latency round loops"] = {{"within 5 s", latency.near.to_json()},
                                 {"elsewhere", latency.rest.to_json()}};
  json["run"] = {{"frames", result.frames.size()},
                 {"wall_seconds", result.wall_seconds},
                 {"cpu_seconds", result.cpu_seconds},
                 {"peak_rss_mb", result.peak_rss_mb}};
  return json;
}

}  // namespace twofold
