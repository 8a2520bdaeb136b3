// pose_graph FILE.g2o[.gz]: solves a pose graph with this project's solver and with Ceres, and compares.

#include <fmt/format.h>
#include <omp.h>
#include <sys/resource.h>

#include <CLI/CLI.hpp>
#include <chrono>
#include <cstdio>
#include <map>

#include "base/processor_time.hpp"
#include "bench/posegraph/ceres_pose_graph.hpp"
#include "fixtures/files/g2o_file.hpp"
#include "posegraph/pose_graph_equations.hpp"
#include "posegraph/pose_graph_initialisation.hpp"

namespace twofold::bench {
namespace {

using Clock = std::chrono::steady_clock;

double milliseconds_since(Clock::time_point start) {
  return std::chrono::duration<double, std::milli>(Clock::now() - start).count();
}

/// Of this thread: on a busy machine the better measure.
double cpu_milliseconds() {
  return 1e-6 * static_cast<double>(thread_cpu_ns());
}

double peak_memory_mib() {
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  return static_cast<double>(usage.ru_maxrss) / 1024;
}

struct Arguments {
  std::string file;
  PoseGraphOptions options;
  CeresOptions ceres;
  bool with_ceres = true;
  bool chordal_ceres = false;
  int repeat = 3;
};

/// One solver's run; times in ms from the call of solve, analysis and start values included.
struct Run {
  const char* name = "";
  int iterations = 0;
  double total_ms = 0;
  double cpu_ms = 0;      ///< of total_ms, those the thread had
  double memory_mib = 0;  ///< peak of the process after the run
  double cost_log = 0;
  double cost_components = 0;
  std::vector<std::pair<double, double>> history;  ///< (ms, optimised cost)

  [[nodiscard]] double ms_to_within(double best, double share) const {
    for (const auto& [ms, cost] : history) {
      if (cost <= best * (1 + share)) return ms;
    }
    return std::numeric_limits<double>::quiet_NaN();
  }
};

/// @param solve  (graph, note_cost): optimises the graph, calls note_cost(cost) where it stands in between,
/// and
///               returns the number of iterations
template <class Group, class Solve>
Run timed(const char* name, PoseGraph<Group> graph, Solve&& solve) {
  Run run;
  run.name = name;
  const auto start = Clock::now();
  const double cpu_start = cpu_milliseconds();
  run.iterations =
      solve(graph, [&](double cost) { run.history.emplace_back(milliseconds_since(start), cost); });
  run.total_ms = milliseconds_since(start);
  run.cpu_ms = cpu_milliseconds() - cpu_start;
  run.memory_mib = peak_memory_mib();
  run.cost_log = pose_graph_cost(graph, PoseGraphError::kLog);
  run.cost_components = pose_graph_cost(graph, PoseGraphError::kComponents);
  return run;
}

template <class Group>
Run run_twofold(const PoseGraph<Group>& start, const Arguments& arguments) {
  return timed("twofold", start, [&](PoseGraph<Group>& graph, const auto& note_cost) {
    PoseGraphOptions options = arguments.options;
    options.on_cost = [&](int, double cost) { note_cost(cost); };
    return PoseGraphSolver<Group>().solve(graph, options).iterations;
  });
}

template <class Group>
Run run_ceres(const PoseGraph<Group>& start, const Arguments& arguments) {
  return timed("ceres", start, [&](PoseGraph<Group>& graph, const auto& note_cost) {
    CeresOptions options = arguments.ceres;
    options.on_cost = note_cost;
    if (arguments.chordal_ceres) {
      PoseGraphEquations<Group> equations;
      equations.analyse(graph);
      PoseGraphPositions<Group> positions(graph, equations.structure);
      graph.poses = chordal_initialisation(graph, equations.structure, positions);
    }
    return solve_with_ceres(graph, options).iterations;
  });
}

/// The run with the median total time of `repeat` runs, which differ in nothing else.
template <class F>
Run median_run(int repeat, F&& run) {
  std::vector<Run> runs;
  for (int i = 0; i < repeat; ++i) runs.push_back(run());
  std::sort(runs.begin(), runs.end(), [](const Run& a, const Run& b) { return a.total_ms < b.total_ms; });
  return runs[runs.size() / 2];
}

template <class Group>
void compare(const PoseGraph<Group>& graph, const Arguments& arguments) {
  fmt::print("{}: {} poses, {} constraints\n", arguments.file, graph.poses.size(), graph.constraints.size());
  fmt::print("start: cost {:.8g} (log), {:.8g} (g2o)\n", pose_graph_cost(graph, PoseGraphError::kLog),
             pose_graph_cost(graph, PoseGraphError::kComponents));
  const bool log = arguments.options.error == PoseGraphError::kLog;
  std::vector<Run> runs{median_run(arguments.repeat, [&] { return run_twofold(graph, arguments); })};
  if (arguments.with_ceres) {
    runs.push_back(median_run(arguments.repeat, [&] { return run_ceres(graph, arguments); }));
  }
  // Ceres minimises g2o's error: with --error log each solver is held against its own best.
  const auto best_of = [&](const Run& r) {
    if (log) return r.history.back().second;
    double best = std::numeric_limits<double>::infinity();
    for (const Run& other : runs) best = std::min(best, other.cost_components);
    return best;
  };
  fmt::print("{:10} {:>14} {:>14} {:>6} {:>10} {:>10} {:>12} {:>10}\n", "solver", "cost (log)", "cost (g2o)",
             "iter.", "total ms", "CPU ms", "ms to 1 %", "peak MiB");
  for (const Run& r : runs) {
    fmt::print("{:10} {:14.8g} {:14.8g} {:6d} {:10.2f} {:10.2f} {:12.2f} {:10.1f}\n", r.name, r.cost_log,
               r.cost_components, r.iterations, r.total_ms, r.cpu_ms, r.ms_to_within(best_of(r), 0.01),
               r.memory_mib);
  }
  if (runs.size() == 2) {
    fmt::print("cost twofold / ceres (g2o): {:.6f}; time ceres / twofold: {:.2f} total, {:.2f} to 1 %\n",
               runs[0].cost_components / runs[1].cost_components, runs[1].total_ms / runs[0].total_ms,
               runs[1].ms_to_within(best_of(runs[1]), 0.01) / runs[0].ms_to_within(best_of(runs[0]), 0.01));
  }
}

int run(int argc, char** argv) {
  Arguments arguments;
  arguments.options.error = PoseGraphError::kComponents;
  arguments.options.chordal_start = true;
  bool no_ceres = false, no_chordal = false;
  CLI::App app{
      "Solves a pose graph with this project's solver and with Ceres, one thread each, from the same start"};
  app.add_option("file", arguments.file, "pose graph, g2o text (.g2o or .g2o.gz)")->required();
  app.add_option("--error", arguments.options.error, "error to minimise: log (thesis 5.15) or g2o")
      ->transform(CLI::CheckedTransformer(std::map<std::string, PoseGraphError>{
          {"log", PoseGraphError::kLog}, {"g2o", PoseGraphError::kComponents}}));
  app.add_option("--jacobian", arguments.options.jacobian,
                 "Jacobian of the log error: CBH order 1, 2, 3 or exact")
      ->transform(CLI::CheckedTransformer(std::map<std::string, CbhOrder>{{"1", CbhOrder::kFirst},
                                                                          {"2", CbhOrder::kSecond},
                                                                          {"3", CbhOrder::kThird},
                                                                          {"exact", CbhOrder::kExact}}));
  app.add_option("--huber", arguments.options.huber, "Huber threshold of this project's solver, 0: none");
  app.add_option("--tolerance", arguments.options.relative_decrease,
                 "stop below this relative decrease, both solvers");
  app.add_option("--max-iterations", arguments.options.max_iterations, "of this project's solver");
  app.add_option("--repeat", arguments.repeat, "runs of each solver; the median time is shown")
      ->check(CLI::Range(1, 99));
  app.add_flag("--no-chordal", no_chordal, "start from the file's poses, without chordal relaxation");
  app.add_flag("--chordal-ceres", arguments.chordal_ceres,
               "Ceres starts from this project's chordal relaxation, whose time then is Ceres's too");
  app.add_flag("--no-ceres", no_ceres, "this project's solver alone");
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& e) {
    return app.exit(e) == 0 ? 0 : 2;
  }
  arguments.ceres.function_tolerance = arguments.options.relative_decrease;
  arguments.with_ceres = !no_ceres;
  if (no_chordal) arguments.options.chordal_start = false;
  if (const auto reason = arguments.options.invalid_reason(); !reason.empty()) {
    fmt::print(stderr, "pose_graph: {}\n", reason);
    return 2;
  }
  // One thread for Ceres too: the supernodal code of its CHOLMOD asks for four at every small copy loop,
  // whatever omp_set_num_threads says.
  omp_set_max_active_levels(0);
  try {
    const AnyPoseGraph graph = read_g2o(arguments.file);
    std::visit([&](const auto& g) { compare(g, arguments); }, graph);
  } catch (const std::runtime_error& e) {
    fmt::print(stderr, "pose_graph: {}\n", e.what());
    return 2;
  }
  return 0;
}

}  // namespace
}  // namespace twofold::bench

int main(int argc, char** argv) {
  return twofold::bench::run(argc, argv);
}
