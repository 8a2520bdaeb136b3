// What the mapper costs at 300, 3,000 and 20,000 keyframes, and what browsing a mapped place does to memory.
// Simulated stereo camera, known truth; the maps are made by the mapper itself, with small windows where only
// the size of the map matters.
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <chrono>
#include <cmath>
#include <fstream>
#include <memory>
#include <nlohmann/json.hpp>

#include "bench/mapping/simulated_run.hpp"
#include "fixtures/live_memory.hpp"
#include "graph/neighbourhood.hpp"

namespace twofold {
namespace {

using Clock = std::chrono::steady_clock;
using simulation::Simulation;

double us_since(Clock::time_point start) {
  return std::chrono::duration<double, std::micro>(Clock::now() - start).count();
}

struct Measurement {
  std::size_t keyframes = 0;
  Samples round_ms, publish_us, destroy_us, search_us;
  MapperReport::Times stages;  ///< sum over the rounds
  MapperReport last;
};

/// Rounds with the default windows, each followed by a publication that outlives the next round.
Measurement measure_rounds(Simulation& simulation, Mapper& mapper, int rounds) {
  Measurement result;
  auto published = std::make_unique<GraphSnapshot>(mapper.publish());
  VisitedSet visited;
  std::vector<TreeNode> tree;
  for (int n = 0; n < rounds; ++n) {
    result.last = map_next(simulation, mapper);
    const auto& ms = result.last.ms;
    result.round_ms.add(ms.total());
    for (const auto stage :
         {&MapperReport::Times::insert, &MapperReport::Times::window, &MapperReport::Times::build,
          &MapperReport::Times::solve, &MapperReport::Times::write, &MapperReport::Times::loop,
          &MapperReport::Times::cull}) {
      result.stages.*stage += ms.*stage / rounds;
    }
    auto start = Clock::now();
    auto next = std::make_unique<GraphSnapshot>(mapper.publish());
    result.publish_us.add(us_since(start));
    start = Clock::now();
    published.reset();
    result.destroy_us.add(us_since(start));
    published = std::move(next);
    start = Clock::now();
    weighted_breadth_first(*published, published->reference(), 200, visited, tree);
    result.search_us.add(us_since(start));
  }
  result.keyframes = mapper.graph().keyframe_count();
  return result;
}

struct LoopMeasurement {
  Samples round_ms;     ///< of the mapper, with a constraint
  double relax_ms = 0;  ///< beside the mapper
  double take_ms = 0;   ///< of the mapper: all poses outside of its windows
  int moved = 0;
  int window = 0;  ///< keyframes, once it reaches across a loop
};

/// The newest keyframe sees the places of some from the map's beginning, a hand's breadth off.
LoopMeasurement measure_loops(const Rig& rig, Mapper& mapper) {
  constexpr std::uint32_t kLoops = 9;
  LoopMeasurement result;
  for (std::uint32_t n = 1; n <= kLoops; ++n) {
    const GraphSnapshot graph = mapper.publish();
    LoopConstraint loop;
    loop.from = graph.reference();
    loop.to = KeyframeId{static_cast<std::uint32_t>(graph.keyframe_count()) * n / (2 * kLoops)};
    loop.inliers = 60;
    const SE3 drift = SE3(SO3::exp(Vector3(0, 0.01, 0)), Vector3(0.1, 0.02, -0.05));
    loop.T_to_from = drift * graph.T_k_w(loop.to) * graph.T_k_w(loop.from).inverse();
    const auto start = Clock::now();
    const MapperReport report = mapper.step({}, std::span(&loop, 1));
    result.round_ms.add(1e-3 * us_since(start));
    result.window = report.inner_window + report.outer_window;
  }
  const GraphSnapshot closed = mapper.publish();
  PoseGraphReport report;
  auto start = Clock::now();
  const PoseGraphUpdate optimised =
      optimise_component(closed, closed.reference(), rig, mapper.options(), report);
  result.relax_ms = 1e-3 * us_since(start);
  start = Clock::now();
  result.moved = mapper.take_pose_graph(optimised);
  result.take_ms = 1e-3 * us_since(start);
  return result;
}

nlohmann::json explore(const std::vector<int>& sizes, int rounds) {
  nlohmann::json out = nlohmann::json::array();
  fmt::print(
      "{:>9} {:>9} {:>9} {:>9} {:>9} {:>9} {:>9} {:>11}   stages [ms]: insert window build solve write "
      "loop cull\n",
      "keyframes", "round ms", "p99 ms", "publ. us", "p99 us", "destr. us", "search us", "KiB/keyfr.");
  for (const int size : sizes) {
    Simulation simulation = exploration(size + rounds);
    auto filler = std::make_unique<Mapper>(simulation.rig(), exploring(3, 6), simulation.search(10));
    const auto fill = [&](Mapper& mapper, std::size_t until) {
      while (mapper.graph().keyframe_count() < until) map_next(simulation, mapper);
    };
    fill(*filler, static_cast<std::size_t>(size) - 60);
    auto mapper = std::make_unique<Mapper>(simulation.rig(), exploring(25, 175), simulation.search(10));
    mapper->continue_from(filler->publish());
    filler.reset();
    fill(*mapper, static_cast<std::size_t>(size));
    const Measurement m = measure_rounds(simulation, *mapper, rounds);
    const LoopMeasurement loops = measure_loops(simulation.rig(), *mapper);
    // What the mapper and its graph hold is what comes back when they go.
    const std::size_t with = live_heap_bytes();
    mapper.reset();
    const double kib =
        static_cast<double>(with - live_heap_bytes()) / 1024 / static_cast<double>(m.keyframes);
    fmt::print(
        "{:9} {:9.2f} {:9.2f} {:9.2f} {:9.2f} {:9.1f} {:9.1f} {:11.1f}   {:.2f} {:.2f} {:.2f} {:.2f} "
        "{:.2f} {:.2f} {:.2f}\n",
        m.keyframes, m.round_ms.median(), m.round_ms.quantile(0.99), m.publish_us.median(),
        m.publish_us.quantile(0.99), m.destroy_us.median(), m.search_us.median(), kib, m.stages.insert,
        m.stages.window, m.stages.build, m.stages.solve, m.stages.write, m.stages.loop, m.stages.cull);
    fmt::print("          windows {} + {}, {} points, {} measurements, {} pose-pose constraints\n",
               m.last.inner_window, m.last.outer_window, m.last.points, m.last.observations,
               m.last.constraints);
    fmt::print(
        "          large loops: round {:.2f} ms with {} keyframes; optimised beside it in {:.0f} ms; {} "
        "poses "
        "taken in {:.2f} ms\n",
        loops.round_ms.median(), loops.window, loops.relax_ms, loops.moved, loops.take_ms);
    std::fflush(stdout);
    out.push_back({{"keyframes", m.keyframes},
                   {"round_ms_median", m.round_ms.median()},
                   {"round_ms_p99", m.round_ms.quantile(0.99)},
                   {"publish_us_median", m.publish_us.median()},
                   {"publish_us_p99", m.publish_us.quantile(0.99)},
                   {"destroy_us_median", m.destroy_us.median()},
                   {"search_us_median", m.search_us.median()},
                   {"kib_per_keyframe", kib},
                   {"solve_ms", m.stages.solve},
                   {"loop_round_ms", loops.round_ms.median()},
                   {"loop_relax_ms", loops.relax_ms},
                   {"loop_take_ms", loops.take_ms},
                   {"points", m.last.points},
                   {"measurements", m.last.observations},
                   {"constraints", m.last.constraints}});
  }
  return out;
}

}  // namespace
}  // namespace twofold

int main(int argc, char** argv) {
  CLI::App app("Cost of the mapper against the size of the map");
  std::vector<int> sizes{300, 3000, 20000};
  int rounds = 100, laps = 20;
  double hours = 0, keyframe_rate = 2;
  bool only_browse = false;
  std::string json_file;
  app.add_option("--keyframes", sizes, "Sizes of the explored map")->check(CLI::Range(100, 1000000));
  app.add_option("--rounds", rounds, "Rounds measured at each size")->check(CLI::Range(2, 100000));
  app.add_option("--laps", laps, "Laps of browsing, 0 for none")->check(CLI::Range(0, 10000));
  app.add_option("--hours", hours, "Browse for so long instead, time-compressed")
      ->check(CLI::Range(0.0, 100.0));
  app.add_option("--keyframe-rate", keyframe_rate, "Keyframes a second for --hours")
      ->check(CLI::Range(0.01, 30.0));
  app.add_flag("--only-browse", only_browse, "No exploration");
  app.add_option("--json", json_file, "Also write the figures to this file");
  CLI11_PARSE(app, argc, argv);
  nlohmann::json result;
  if (!only_browse) result["exploration"] = twofold::explore(sizes, rounds);
  if (hours > 0) laps = static_cast<int>(std::ceil(3600 * hours * keyframe_rate / twofold::kBrowsedLap));
  if (laps > 0) result["browsing"] = twofold::browse(laps);
  if (!json_file.empty()) {
    std::ofstream out(json_file);
    out << result.dump(2) << "\n";
    if (!out) {
      fmt::print(stderr, "{}: cannot be written\n", json_file);
      return 1;
    }
  }
  return 0;
}
