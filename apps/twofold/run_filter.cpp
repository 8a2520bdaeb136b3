#include "apps/twofold/run_filter.hpp"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <chrono>
#include <cmath>
#include <nlohmann/json.hpp>

#include <fmt/format.h>

#include "base/counted.hpp"
#include "base/text_of_json.hpp"
#include "io/files/io_error.hpp"
#include "io/files/output_file.hpp"
#include "io/files/ply.hpp"
#include "io/files/trajectory_file.hpp"
#include "io/sources/source_path.hpp"
#include "structure/structure_filter.hpp"

namespace twofold {
namespace {

// A point measured less often may be a mismatch that nothing contradicted.
constexpr int kMinMeasurements = 3;

std::vector<PlyPoint> surface_points(const StructureFilter& filter) {
  std::vector<PlyPoint> points;
  for (const auto& [id, point] : filter.points()) {
    if (point.measurements < kMinMeasurements || point.covariance.isZero(0)) continue;
    const Eigen::SelfAdjointEigenSolver<Matrix3> eigen(point.covariance, Eigen::EigenvaluesOnly);
    PlyPoint ply;
    ply.x_w = point.x_w;
    ply.rgb = {point.grey, point.grey, point.grey};
    ply.stddev = static_cast<float>(std::sqrt(std::max(0.0, eigen.eigenvalues()[2])));
    points.push_back(ply);
  }
  return points;
}

struct Timing {
  double wall_seconds = 0;
  double busy_ms = 0;     ///< in the filter
  double slowest_ms = 0;  ///< of a frame
};

Timing process_all(FrameSource& source, const std::atomic<bool>& stop, StructureFilter& filter) {
  using Clock = std::chrono::steady_clock;
  using Milliseconds = std::chrono::duration<double, std::milli>;
  Timing timing;
  const auto start = Clock::now();
  Frame frame;
  // Relaxed: the flag carries no other data.
  while (!stop.load(std::memory_order_relaxed) && source.next(frame) == FrameStatus::kFrame) {
    const auto before = Clock::now();
    filter.process(frame);
    const double took_ms = Milliseconds(Clock::now() - before).count();
    timing.busy_ms += took_ms;
    timing.slowest_ms = std::max(timing.slowest_ms, took_ms);
  }
  timing.wall_seconds = std::chrono::duration<double>(Clock::now() - start).count();
  return timing;
}

/// Writes the trajectories and the truth; returns how many frames were tracked.
std::size_t write_trajectories(const StructureFilter& filter, const FrameSource& source,
                               const std::filesystem::path& folder) {
  Trajectory smoothed, causal;
  for (const StructureFrame& f : filter.frames()) {
    if (!f.tracked) continue;
    smoothed.push_back({f.t_ns, f.T_c_w_smoothed.inverse()});
    causal.push_back({f.t_ns, f.T_c_w.inverse()});
  }
  write_tum_trajectory(folder / "trajectory.txt", smoothed);
  write_tum_trajectory(folder / "trajectory_causal.txt", causal);
  if (!source.ground_truth().empty()) write_tum_trajectory(folder / "groundtruth.txt", source.ground_truth());
  return smoothed.size();
}

/// Empty: none.
std::string failure_of(const FrameSource& source, const std::string& source_text, std::size_t tracked) {
  if (!source.error().empty()) return source.error();
  return tracked < 2 ? source_text + ": no frame could be tracked" : "";
}

}  // namespace

void expect_stereo(const Rig& rig, const std::string& source_text) {
  if (rig.kind != SensorKind::kStereo)
    throw IoError(source_text, "is not stereo, which --estimator swf needs");
}

void run_filter(FrameSource& source, const std::string& source_text, int window,
                const std::filesystem::path& folder, const std::atomic<bool>& stop) {
  StructureOptions options;
  options.filter.window = window;
  StructureFilter filter(source.rig(), options);
  const Timing timing = process_all(source, stop, filter);
  const std::size_t tracked = write_trajectories(filter, source, folder);
  const std::vector<PlyPoint> points = surface_points(filter);
  write_ply(folder / "structure.ply", points);
  const std::size_t frames = filter.frames().size();
  const double mean_ms = timing.busy_ms / static_cast<double>(std::max<std::size_t>(1, frames));
  const std::string error = failure_of(source, source_text, tracked);
  using Json = nlohmann::ordered_json;
  const Json summary{{"source", absolute_source(source_text)},
                     {"estimator", "swf"},
                     {"window", window},
                     {"interrupted", stop.load(std::memory_order_relaxed)},
                     {"error", error},
                     {"errors", error.empty() ? Json::array() : Json::array({error})},
                     {"frames", frames},
                     {"tracked", tracked},
                     {"lost", frames - tracked},
                     {"restarts", filter.restarts()},
                     {"points", points.size()},
                     {"wall_seconds", timing.wall_seconds},
                     {"mean_ms", mean_ms},
                     {"slowest_ms", timing.slowest_ms},
                     {"notes", source.report().notes}};
  write_file(folder / "summary.json", text_of_json(summary, 2) + "\n");
  fmt::print("{}, {} tracked, {}, {}; {:.1f} ms a frame, slowest {:.1f}; {}\n", counted(frames, "frame"),
             tracked, counted(filter.restarts(), "restart"), counted(points.size(), "point"), mean_ms,
             timing.slowest_ms, folder.string());
  for (const std::string& note : source.report().notes) fmt::print("note        {}\n", note);
  if (!source.error().empty()) throw IoError(error);
  if (!error.empty()) throw std::runtime_error(error);
}

}  // namespace twofold
