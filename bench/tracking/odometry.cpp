#include <CLI/CLI.hpp>
#include <algorithm>
#include <array>
#include <deque>
#include <exception>
#include <numeric>
#include <optional>
#include <vector>

#include <fmt/core.h>

#include "base/processor_time.hpp"
#include "camera/measurement.hpp"
#include "evaluation/evaluation.hpp"
#include "fixtures/plain_map.hpp"
#include "io/files/trajectory_file.hpp"
#include "io/sources/open_source.hpp"
#include "mapping/mapper.hpp"
#include "tracking/tracker.hpp"

// The tracker in lockstep with a map, by default one that is never optimised: time a frame by stage, drift
// against ground truth.

namespace twofold {
namespace {

struct Arguments {
  std::string source;
  std::string trajectory;
  int map_delay = 2;  ///< frames between a proposal and the snapshot that has it
  bool verbose = false;
  bool residuals = false;
  bool mapper = false;  ///< the real back-end instead of the plain map
  TrackerOptions tracker;
};

struct TrackedFrame {
  std::int64_t t_ns = 0;
  TrackResult result;
  double cpu_ms = 0;
};

double percentile(std::vector<double> values, double share) {
  if (values.empty()) return 0;
  std::sort(values.begin(), values.end());
  return values[static_cast<std::size_t>(share * static_cast<double>(values.size() - 1) + 0.5)];
}

double mean(const std::vector<double>& values) {
  return values.empty()
             ? 0
             : std::accumulate(values.begin(), values.end(), 0.0) / static_cast<double>(values.size());
}

void print_frame(const Frame& frame, const TrackResult& r, double cpu_ms) {
  fmt::print(
      "{:5d} {} ref {:4d} cand {:4d} searched {:3d} matched {:3d} inliers {:3d} rms {:5.2f} {:5.2f} ms {} "
      "{}\n",
      frame.index, r.status == TrackStatus::kTracking ? "ok  " : "LOST",
      static_cast<std::int64_t>(index(r.reference)), r.candidates, r.searched, r.matches, r.inliers,
      r.alignment_rms, cpu_ms, r.proposed ? "keyframe" : "", describe(r.cause));
}

/// Residuals (predicted minus measured) in pixels of the level they were measured on.
struct ResidualStatistics {
  std::array<std::array<std::vector<double>, 3>, 4> by_level;
  std::array<std::array<int, 2>, 4> inliers{};

  void add(const Rig& rig, const SE3& T_c_ref, std::span<const MotionObservation> observations) {
    const double finest = rig.information({0, 0, 0}, 0).x();
    for (const MotionObservation& o : observations) {
      const auto level = static_cast<std::size_t>(std::lround(0.5 * std::log2(finest / o.information.x())));
      if (level >= by_level.size()) continue;
      const Vector3 error = (rig.project(T_c_ref * o.x_ref) - o.pixel.cast<double>()) *
                            std::ldexp(1.0, -static_cast<int>(level));
      ++inliers[level][o.inlier ? 1 : 0];
      for (std::size_t k = 0; k < 3; ++k) {
        if (k < 2) by_level[level][k].push_back(std::abs(error[static_cast<int>(k)]));
        // Of the disparity: the right coordinate alone repeats u.
        else if (weighs_right(o.information))
          by_level[level][k].push_back(std::abs(error.x() - error.z()));
      }
    }
  }
  void print() const;
};

void ResidualStatistics::print() const {
  for (std::size_t level = 0; level < by_level.size(); ++level) {
    const auto& e = by_level[level];
    fmt::print("  level {}: {} in, {} out;", level, inliers[level][1], inliers[level][0]);
    const char* names[] = {"u", "v", "disparity"};
    for (std::size_t k = 0; k < 3; ++k) {
      fmt::print("  |{}| median {:.3f} 68 % {:.3f} 90 % {:.2f}", names[k], percentile(e[k], 0.5),
                 percentile(e[k], 0.68), percentile(e[k], 0.9));
    }
    fmt::print("\n");
  }
}

/// Either map behind one face.
class Map {
 public:
  Map(const Rig& rig, bool optimised) {
    if (optimised) mapper_.emplace(rig, MapperOptions{});
  }
  void insert(KeyframeProposal& proposal) {
    if (!mapper_) return plain_.insert(proposal);
    KeyframeProposal* one = &proposal;
    mapper_->step(std::span(&one, 1));
  }
  [[nodiscard]] GraphSnapshot publish() { return mapper_ ? mapper_->publish() : plain_.publish(); }

 private:
  PlainMap plain_;
  std::optional<Mapper> mapper_;
};

std::vector<TrackedFrame> track(FrameSource& source, const Arguments& arguments, Map& map,
                                ResidualStatistics& residuals) {
  Tracker tracker(source.rig(), arguments.tracker);
  GraphSnapshot snapshot = map.publish();
  std::deque<std::pair<std::int64_t, KeyframeProposal>> queue;
  std::vector<TrackedFrame> frames;
  Frame frame;
  KeyframeProposal proposal;
  while (source.next(frame) == FrameStatus::kFrame) {
    bool changed = false;
    while (!queue.empty() && queue.front().first <= frame.index) {
      map.insert(queue.front().second);
      queue.pop_front();
      changed = true;
    }
    if (changed) snapshot = map.publish();
    const std::int64_t start = thread_cpu_ns();
    const TrackResult result = tracker.step(frame, snapshot, &proposal);
    const double cpu_ms = 1e-6 * static_cast<double>(thread_cpu_ns() - start);
    if (result.proposed) queue.emplace_back(frame.index + arguments.map_delay, proposal);
    frames.push_back({frame.t_ns, result, cpu_ms});
    if (result.status == TrackStatus::kTracking)
      residuals.add(source.rig(), result.T_c_ref, tracker.last_observations());
    if (arguments.verbose) print_frame(frame, result, cpu_ms);
  }
  for (auto& [when, late] : queue) map.insert(late);
  if (!source.error().empty()) throw std::runtime_error(source.error());
  return frames;
}

void print_times(const std::vector<TrackedFrame>& frames) {
  std::vector<double> cpu;
  std::array<std::vector<double>, kTrackerStages> stages;
  for (std::size_t i = 1; i < frames.size(); ++i) {  // the first fills buffers
    cpu.push_back(frames[i].cpu_ms);
    for (std::size_t s = 0; s < kTrackerStages; ++s)
      stages[s].push_back(1e-6 * static_cast<double>(frames[i].result.stage_ns[s]));
  }
  fmt::print("cpu ms a frame: mean {:.2f} median {:.2f} p99 {:.2f} max {:.2f}\n", mean(cpu),
             percentile(cpu, 0.5), percentile(cpu, 0.99), percentile(cpu, 1));
  for (std::size_t s = 0; s < kTrackerStages; ++s) {
    fmt::print("  {:24s} mean {:.3f} median {:.3f} p99 {:.3f}\n", describe(static_cast<TrackerStage>(s)),
               mean(stages[s]), percentile(stages[s], 0.5), percentile(stages[s], 0.99));
  }
}

void print_counts(const std::vector<TrackedFrame>& frames) {
  int tracked = 0, keyframes = 0;
  double searched = 0, matches = 0, inliers = 0;
  for (const TrackedFrame& f : frames) {
    keyframes += f.result.proposed;
    if (f.result.status != TrackStatus::kTracking) continue;
    ++tracked, searched += f.result.searched, matches += f.result.matches, inliers += f.result.inliers;
  }
  const double n = std::max(1, tracked);
  fmt::print("frames {} tracked {} keyframes {}; a frame: searched {:.0f} matched {:.0f} inliers {:.0f}\n",
             frames.size(), tracked, keyframes, searched / n, matches / n, inliers / n);
}

Trajectory compose(const std::vector<TrackedFrame>& frames, const GraphSnapshot& graph) {
  Trajectory trajectory;
  for (const TrackedFrame& f : frames) {
    if (f.result.status == TrackStatus::kTracking)
      trajectory.push_back({f.t_ns, (f.result.T_c_ref * graph.T_k_w(f.result.reference)).inverse()});
    if (f.result.status == TrackStatus::kInitialising && f.result.proposed)
      trajectory.push_back({f.t_ns, SE3()});
  }
  return trajectory;
}

void print_drift(const Trajectory& trajectory, const Trajectory& truth) {
  const auto report = [&](const char* name, const EvaluationOptions& options) {
    const auto evaluation = evaluate(associate(trajectory, truth, 20'000'000), options);
    if (!evaluation) return fmt::print("{}: {}\n", name, evaluation.error());
    fmt::print(
        "{}: scale {:.4f} ATE {:.4f} m ({:.4f} deg) over {:.2f} m; RPE/s {:.4f} m {:.3f} deg; RPE/m {:.2f} "
        "%\n",
        name, evaluation->S_w_e.scale(), evaluation->absolute.rmse, evaluation->absolute_rotation_deg.rmse,
        evaluation->path_length, evaluation->per_second.translation.rmse,
        evaluation->per_second.rotation_deg.rmse, evaluation->per_metre.translation_percent.mean);
  };
  report("SE(3)", {});
  EvaluationOptions sim;
  sim.alignment = Alignment::kSim3;
  report("Sim(3)", sim);
}

void run(const Arguments& arguments) {
  SourceOptions source_options;
  source_options.preload = true;
  const auto source = open_source(arguments.source, source_options);
  Map map(source->rig(), arguments.mapper);
  ResidualStatistics residuals;
  const std::vector<TrackedFrame> frames = track(*source, arguments, map, residuals);
  const Trajectory trajectory = compose(frames, map.publish());
  print_counts(frames);
  if (arguments.residuals) residuals.print();
  print_times(frames);
  if (!source->ground_truth().empty()) print_drift(trajectory, source->ground_truth());
  if (!arguments.trajectory.empty()) write_tum_trajectory(arguments.trajectory, trajectory);
}

}  // namespace
}  // namespace twofold

int main(int argc, char** argv) {
  twofold::Arguments arguments;
  CLI::App app("Tracker without a back-end: time and drift");
  app.add_option("source", arguments.source, "recording or scheme:ARGUMENT")->required();
  app.add_option("--trajectory", arguments.trajectory, "write the trajectory here (TUM)");
  app.add_option("--map-delay", arguments.map_delay, "frames until a proposal is in the map");
  app.add_flag("-v,--verbose", arguments.verbose, "a line for every frame");
  app.add_flag("--residuals", arguments.residuals, "statistics of the reprojection errors");
  app.add_flag("--mapper", arguments.mapper, "optimise the map (double window)");
  CLI11_PARSE(app, argc, argv);
  try {
    twofold::run(arguments);
  } catch (const std::exception& error) {
    fmt::print(stderr, "odometry: {}\n", error.what());
    return 1;
  }
  return 0;
}
