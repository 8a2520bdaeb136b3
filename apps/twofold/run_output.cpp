#include "apps/twofold/run_output.hpp"

#include <algorithm>
#include <cmath>
#include <fstream>
#include <map>
#include <numbers>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "apps/twofold/graph_export.hpp"
#include "apps/twofold/loop_latency.hpp"
#include "apps/twofold/map_options.hpp"
#include "apps/twofold/output/output_folder.hpp"
#include "apps/twofold/run_summary.hpp"
#include "apps/twofold/view/run_frames.hpp"
#include "base/counted.hpp"
#include "base/text_of_json.hpp"
#include "engine/health.hpp"
#include "evaluation/evaluation.hpp"
#include "io/files/io_error.hpp"
#include "io/files/output_file.hpp"
#include "io/files/ply.hpp"
#include "io/files/trajectory_file.hpp"
#include "io/plots/plot.hpp"

namespace twofold {
namespace {

/// Causal poses of the map part that most frames were tracked in: other parts had other worlds, as far as was
/// known then.
Trajectory causal_trajectory(const RunResult& result) {
  std::map<KeyframeId, Trajectory> parts;
  for (const FrameRecord& record : result.frames) {
    if (record.state == FrameState::kTracked)
      parts[record.part_causal].push_back({record.t_ns, record.T_c_w_causal.unpacked().inverse()});
  }
  const auto most = std::max_element(parts.begin(), parts.end(), [](const auto& a, const auto& b) {
    return a.second.size() < b.second.size();
  });
  return most == parts.end() ? Trajectory() : std::move(most->second);
}

/// The run has written the file as it went: at no time is there none.
void replace_causal_trajectory(const std::filesystem::path& file, const Trajectory& poses) {
  const std::filesystem::path beside = file.string() + ".new";
  write_tum_trajectory(beside, poses);
  std::error_code error;
  std::filesystem::rename(beside, file, error);
  if (error) throw WriteError(file, "cannot be written: " + error.message());
}

/// At most so many poses as a picture can show, from all over the trajectory.
Trajectory thinned(const Trajectory& poses) {
  constexpr std::size_t kMost = 100'000;
  const std::size_t step = 1 + poses.size() / kMost;
  Trajectory some;
  for (std::size_t i = 0; i < poses.size(); i += step) some.push_back(poses[i]);
  return some;
}

/// The run and the truth from above; without truth, the run alone.
cv::Mat draw_run(const std::string& source_text, const Trajectory& final_poses,
                 const Trajectory& causal_poses, const Trajectory& truth, Alignment alignment) {
  PlotOptions plot;
  plot.title = source_text;
  plot.subtitle = fmt::format("{} poses{}", final_poses.size(),
                              alignment == Alignment::kSim3 ? ", of an arbitrary unit of length" : "");
  plot.metric = alignment != Alignment::kSim3;
  Trajectory shown = thinned(final_poses);
  Trajectory shown_causal = thinned(causal_poses);
  const auto pairs = associate(final_poses, truth, 10'000'000);
  if (const auto evaluation = evaluate(pairs, {.alignment = alignment})) {
    for (auto& pose : shown) pose.T_w_c = aligned_pose(evaluation->S_w_e, pose.T_w_c);
    for (auto& pose : shown_causal) pose.T_w_c = aligned_pose(evaluation->S_w_e, pose.T_w_c);
    plot.subtitle = fmt::format("{} poses, {:.1f} m, final ATE {:.4f} m ({:.3f} %){}", final_poses.size(),
                                evaluation->path_length, evaluation->absolute.rmse,
                                100 * evaluation->absolute.rmse / std::max(evaluation->path_length, 1e-9),
                                alignment == Alignment::kSim3 ? ", aligned with scale" : "");
    plot.metric = true;  // the truth's unit
  }
  plot.up_axis = truth.empty() ? 1 : up_axis_of(truth);
  return draw_top_down({{"ground truth", positions(truth), plot_colours::kTruth, 4, {}},
                        {"causal", positions(shown_causal), plot_colours::kCausal, 1, {}},
                        {"final", positions(shown), plot_colours::kFinal, 2, {}}},
                       plot);
}

nlohmann::ordered_json focal_length_json(const Rig& rig, const std::optional<FocalLengthEstimate>& of_map) {
  if (!of_map) return nullptr;
  return {{"map_px", of_map->scale * rig.camera.fx},
          {"sigma_px", of_map->sigma * rig.camera.fx},
          {"contradicts_calibration", of_map->contradicts_rig()}};
}

nlohmann::ordered_json summary_of(const RunFrames& frames, const FrameSource& source,
                                  const EngineOptions& options, const RunResult& result,
                                  const std::vector<MapPart>& parts, const nlohmann::ordered_json& surface) {
  nlohmann::ordered_json summary = summary_json(frames.source, options, result, parts);
  summary["errors"] = frames.errors;
  summary["error"] = fmt::format("{}", fmt::join(frames.errors, "; "));
  summary["scale"] = scale_is_arbitrary(source.rig(), options) ? "arbitrary" : "metric";
  summary["self_calibration"] = frames.calibration;
  summary["focal_length"] = focal_length_json(source.rig(), result.mapping.focal_length);
  summary["surface"] = surface;
  const auto path_or_null = [](const std::string& file) {
    return file.empty() ? nlohmann::ordered_json(nullptr)
                        : nlohmann::ordered_json(std::filesystem::absolute(file).string());
  };
  summary["calibration_file"] = path_or_null(frames.calibration_file);
  summary["recording"] = path_or_null(frames.recording);
  return summary;
}

}  // namespace

void update_peak_memory(RunResult& result) {
  result.peak_rss_mb = static_cast<double>(process_usage().peak_rss_bytes) / (1 << 20);
}

void write_run_output(const std::filesystem::path& folder, const RunFrames& frames, const FrameSource& source,
                      const EngineOptions& options, const RunResult& result,
                      const std::vector<MapPart>& parts, const nlohmann::ordered_json& surface) {
  // First: it says what the run failed of, also where the disk has no room for what follows.
  const auto summary = summary_of(frames, source, options, result, parts, surface);
  write_file(folder / "summary.json", text_of_json(summary, 2) + "\n");
  const Trajectory& final_poses = parts.front().trajectory;
  const Trajectory causal_poses = causal_trajectory(result);
  write_tum_trajectory(folder / "trajectory.txt", final_poses);
  replace_causal_trajectory(folder / "trajectory_causal.txt", causal_poses);
  remove_part_files(folder, parts.size());
  const auto points = points_with_covariance(source.rig(), result.graph);
  const std::uint32_t loaded = loaded_keyframe_ids(options);
  const bool arbitrary = scale_is_arbitrary(source.rig(), options);
  const LengthUnit unit = arbitrary ? LengthUnit::kArbitrary : LengthUnit::kMetre;
  for (std::size_t n = 0; n < parts.size(); ++n) {
    if (n > 0) write_tum_trajectory(folder / part_file("trajectory", n, ".txt"), parts[n].trajectory);
    const auto [of_loaded_map, own] = loaded_and_own_keyframes(result.graph, parts[n].id, loaded);
    write_tum_trajectory(folder / part_file("keyframes", n, ".txt"), own);
    if (!of_loaded_map.empty())
      write_tum_trajectory(folder / part_file("keyframes_loaded", n, ".txt"), of_loaded_map);
    write_ply(folder / part_file("map", n, ".ply"), map_points(points, result.graph, parts[n].id), unit);
    write_file(folder / part_file("edges", n, ".txt"), edge_list(result.graph, parts[n].id));
  }
  write_run_frames(folder / "frames.txt", result, options.pacing.keeps_pace());
  if (!source.ground_truth().empty()) write_tum_trajectory(folder / "groundtruth.txt", source.ground_truth());
  write_file(folder / "timing.json", text_of_json(timing_json(result), 1) + "\n");
  write_file(folder / "loop_latency.txt", loop_latency_table(loop_latency(result)));
  if (!final_poses.empty()) {
    write_png(folder / "trajectory.png",
              draw_run(frames.source, final_poses, causal_poses, source.ground_truth(),
                       arbitrary ? Alignment::kSim3 : Alignment::kSe3));
  }
}

void write_trace(const std::filesystem::path& file, const RunResult& result) {
  std::ofstream out(file);
  if (!result.trace || !result.trace->write(out))
    throw WriteError(file.string(), "the trace cannot be written");
}

namespace {

std::string durations(const LatencyHistogram& h) {
  const auto ms = [](std::int64_t ns) { return static_cast<double>(ns) * 1e-6; };
  return fmt::format("mean {:.2f} ms, p50 {:.2f}, p99 {:.2f}, max {:.2f}", h.mean_ns() * 1e-6,
                     ms(h.quantile_ns(0.5)), ms(h.quantile_ns(0.99)), ms(h.max_ns()));
}

/// What each loop found before it was closed, a line a loop. Only one camera's has a scale to tell.
void print_loops(const Rig& rig, const EngineOptions& options, const RunResult& result) {
  constexpr std::size_t kMost = 12;
  const char* const unit = scale_is_arbitrary(rig, options) ? "" : " m";
  for (std::size_t n = 0; n < std::min(kMost, result.loops.size()); ++n) {
    const ClosedLoop& loop = result.loops[n];
    const auto [from, to] = std::pair(index(loop.constraint.from), index(loop.constraint.to));
    if (loop.joins_parts) {
      fmt::print("loop        keyframes {} and {}: joins two map parts\n", from, to);
      continue;
    }
    const SE3 drift = loop.drift();
    const double moved = drift.translation().norm();
    const std::string scale =
        rig.kind == SensorKind::kMono ? fmt::format(", scale {:.4f}", loop.constraint.scale) : "";
    fmt::print(
        "loop        keyframes {} and {}: drift {:.4f}{} ({:.3f} % of {:.1f}{} travelled), {:.2f} "
        "degrees{}\n",
        from, to, moved, unit, 100 * moved / std::max(loop.travelled, 1e-9), loop.travelled, unit,
        drift.so3().log().norm() * 180 / std::numbers::pi, scale);
  }
  if (result.loops.size() > kMost) fmt::print("loop        {} more\n", result.loops.size() - kMost);
}

/// Maps beside the one that the run made: loaded, saved on the way, of parts that never joined.
void print_other_maps(const EngineOptions& options, const RunResult& result,
                      const std::vector<MapPart>& parts) {
  if (options.map) {
    const auto frame = recognised_at(options, result);
    fmt::print("loaded map  {}, {}\n", counted(live_keyframes(options.map->graph), "keyframe"),
               frame ? fmt::format("recognised at frame {}", *frame)
                     : std::string("no place of it was recognised: poses are not in its frame"));
  }
  if (const CheckpointReport& c = result.checkpoints; options.checkpoint.period > 0) {
    fmt::print("checkpoints {} saved, the slowest in {:.0f} ms{}{}\n", c.saved,
               static_cast<double>(c.longest_ns) * 1e-6, c.error.empty() ? "" : "; one failed: ", c.error);
  }
  for (const MapPart& part : parts) {
    if (parts.size() == 1) break;
    fmt::print("map part    {}, {}, first keyframe {}\n", counted(part.keyframes, "keyframe"),
               counted(part.trajectory.size(), "frame"), index(part.id));
  }
}

void print_times(const EngineOptions& options, const RunResult& result) {
  for (const StageRecorder& recorder : result.times) {
    if (recorder.thread_name() == "loop closer") continue;
    fmt::print("{:<11} {}\n", recorder.thread_name(), durations(recorder.histogram(0)));
  }
  if (options.pacing.keeps_pace()) fmt::print("exposure to pose: {}\n", durations(exposure_to_pose(result)));
  const auto frames = static_cast<double>(result.frames.size());
  const std::string a_frame =
      frames > 0 ? fmt::format(" ({:.1f} CPU-ms a frame)", 1e3 * result.cpu_seconds / frames) : "";
  fmt::print("cost        {:.1f} s wall, {:.1f} s CPU{}, {:.0f} MiB at most\n", result.wall_seconds,
             result.cpu_seconds, a_frame, result.peak_rss_mb);
}

}  // namespace

void print_summary(const std::filesystem::path& folder, const Rig& rig, const EngineOptions& options,
                   const RunResult& result, const std::vector<MapPart>& parts) {
  const FrameCounts& counts = result.counts;
  const std::string later =
      counts.placed_later > 0 ? fmt::format("{} placed later, ", counts.placed_later) : "";
  fmt::print("frames      {} ({} tracked, {}{} lost, {} dropped){}\n", counts.frames, counts.tracked, later,
             counts.lost, counts.dropped, result.interrupted ? ", interrupted" : "");
  fmt::print("map         {}, {}, {}, {} by appearance\n", counted(live_keyframes(result.graph), "keyframe"),
             counted(result.mapping.rounds, "round"),
             counted(result.mapping.metric_loops, "metric loop edge"), counted(result.loops.size(), "loop"));
  print_loops(rig, options, result);
  if (result.readout && result.readout->significant) {
    fmt::print("readout     {:.1f} +- {:.1f} ms: a rolling shutter, found from {} pairs of frames\n",
               1e3 * result.readout->seconds, 1e3 * result.readout->sigma, result.readout->pairs);
  }
  if (const auto& of_map = result.mapping.focal_length; of_map && of_map->contradicts_rig()) {
    fmt::print(
        "focal       the map shows a focal length of {:.1f} +- {:.1f} px, the calibration says {:.1f}\n",
        of_map->scale * rig.camera.fx, of_map->sigma * rig.camera.fx, rig.camera.fx);
  }
  print_other_maps(options, result, parts);
  print_times(options, result);
  if (result.row_offset != 0)
    fmt::print(
        "rows        right images lie {:.1f} rows {} than left ones: calibrate the pair again; went on with "
        "the rows shifted\n",
        std::abs(result.row_offset), result.row_offset > 0 ? "lower" : "higher");
  for (const std::string& note : result.notes) fmt::print("note        {}\n", note);
  fmt::print("written to  {}\n", folder.string());
}

void print_source_report(const SourceReport& report) {
  for (const std::string& text : report.summary) fmt::print("{}\n", text);
  for (const std::string& text : report.faults) fmt::print("  {}\n", text);
}

bool scale_is_arbitrary(const Rig& rig, const EngineOptions& options) {
  return rig.kind == SensorKind::kMono && !(options.map && options.map->rig.kind != SensorKind::kMono);
}

}  // namespace twofold
