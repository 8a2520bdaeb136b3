// What the adjustment of a whole map costs and gains: a map file, as a run saves it, before and after the
// pose graph of all its keyframes, and after the bundle adjustment of everything
// (mapping/global_adjustment.hpp).
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cmath>
#include <exception>
#include <string>

#include "engine/clock.hpp"
#include "engine/health.hpp"
#include "evaluation/evaluation.hpp"
#include "graph/map_file.hpp"
#include "io/files/trajectory_file.hpp"
#include "mapping/global_adjustment.hpp"
#include "mapping/pose_graph_optimisation.hpp"

namespace twofold {
namespace {

constexpr std::int64_t kSameFrameNs = 10'000'000;

Trajectory keyframes_of(const GraphSnapshot& graph, KeyframeId part) {
  Trajectory poses;
  for (std::uint32_t k = 0; k < graph.keyframe_count(); ++k) {
    const Keyframe& keyframe = graph.keyframe(KeyframeId{k});
    if (!keyframe.culled() && keyframe.part == part)
      poses.push_back({keyframe.t_ns, keyframe.T_k_w.inverse()});
  }
  std::sort(poses.begin(), poses.end(), [](auto& a, auto& b) { return a.t_ns < b.t_ns; });
  return poses;
}

class Table {
 public:
  Table(const Rig& rig, const Trajectory& truth)
      : alignment_(rig.kind == SensorKind::kMono ? Alignment::kSim3 : Alignment::kSe3), truth_(truth) {
    fmt::print("{:<20} {:>9} {:>9} {:>9} {:>9} {:>9} {:>10}\n", "", "seconds", "peak MiB", "ATE m",
               "% of path", "degrees", "halves %");
  }
  void line(const char* name, const GraphSnapshot& graph) {
    const std::int64_t now_ns = steady_now_ns();
    const double mib = static_cast<double>(process_usage().peak_rss_bytes) / (1 << 20);
    fmt::print("{:<20} {:9.2f} {:9.0f}", name, static_cast<double>(now_ns - begin_ns_) * 1e-9, mib);
    const auto pairs = associate(keyframes_of(graph, graph.part(graph.reference())), truth_, kSameFrameNs);
    if (const auto e = evaluate(pairs, {.alignment = alignment_})) {
      fmt::print(" {:9.4f} {:9.4f} {:9.2f}", e->absolute.rmse, 100 * e->absolute.rmse / e->path_length,
                 e->absolute_rotation_deg.rmse);
    }
    if (const auto halves = scales_of_halves(pairs))
      fmt::print(" {:10.3f}", 100 * std::abs((*halves)[0] / (*halves)[1] - 1));
    fmt::print("\n");
    begin_ns_ = steady_now_ns();
  }

 private:
  Alignment alignment_;
  const Trajectory& truth_;
  std::int64_t begin_ns_ = steady_now_ns();
};

void adjust(const std::string& file, const Trajectory& truth, MapperOptions options) {
  const SavedMap map = load_map(file);
  Table table(map.rig, truth);
  GraphWriter writer(map.graph);
  table.line("as saved", writer.graph());
  optimise_all_components(writer, map.rig, options);
  table.line("pose graph", writer.graph());
  std::int64_t begin_ns = steady_now_ns();
  options.solver.keep_going = [&](int iterations, double cost) {
    const std::int64_t now_ns = steady_now_ns();
    fmt::print("  step {:2}: cost {:.6g}, {:.2f} s\n", iterations, cost,
               static_cast<double>(now_ns - begin_ns) * 1e-9);
    begin_ns = now_ns;
    return true;
  };
  const GlobalAdjustmentReport report = adjust_all_components(writer, map.rig, options);
  table.line("adjusted", writer.graph());
  fmt::print(
      "{} keyframes in {} components ({} too large), {} points, {} observations, {} outliers; cost {:.6g} -> "
      "{:.6g}\n",
      report.keyframes, report.components, report.too_large, report.points, report.observations,
      report.outliers, report.initial_cost, report.final_cost);
  if (report.focal_length)
    fmt::print("focal length: {:.1f} px +- {:.2f} %, {:.4f} times that of the map\n",
               report.focal_length->scale * map.rig.camera.fx, 100 * report.focal_length->sigma,
               report.focal_length->scale);
}

}  // namespace
}  // namespace twofold

int main(int argc, char** argv) {
  std::string map, truth;
  twofold::MapperOptions options;
  CLI::App app("What the adjustment of a whole map costs and gains");
  app.add_option("MAP", map, "A map file (twofold run --save-map)")->required();
  app.add_option("TRUTH", truth, "Its run's groundtruth.txt")->required();
  app.add_option("--max-keyframes", options.global.max_keyframes, "Larger maps are left alone")
      ->capture_default_str();
  app.add_option("--iterations", options.global.max_iterations, "Steps a round")->capture_default_str();
  app.add_option("--damping", options.global.initial_damping, "Of the first step of a round")
      ->capture_default_str();
  app.add_option("--relative-decrease", options.global.relative_decrease,
                 "A step that lowers the cost by less than this share is the last one")
      ->capture_default_str();
  app.add_option("--rounds", options.global.rounds, "Outliers are removed after each")->capture_default_str();
  CLI11_PARSE(app, argc, argv);
  try {
    twofold::adjust(map, twofold::read_tum_trajectory(truth), options);
  } catch (const std::exception& error) {
    fmt::print(stderr, "whole_map: {}\n", error.what());
    return 2;
  }
}
