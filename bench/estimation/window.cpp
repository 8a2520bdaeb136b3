// bench/window [FILE]: one double-window problem (eq. 6.4), generated or dumped from a run, by WindowSolver
// and by Ceres.
#include <CLI/CLI.hpp>
#include <cstdio>
#include <fstream>

#include "bench/estimation/solver_race.hpp"
#include "bench/estimation/typical_window.hpp"
#include "fixtures/files/window_problem_io.hpp"

namespace twofold {
namespace {

struct Arguments {
  std::string file;
  std::string dump;
  SyntheticWindowOptions generator = typical_window_options();
  RaceOptions race;
};

void run(const Arguments& arguments) {
  const WindowProblem problem = arguments.file.empty() ? make_synthetic_window(arguments.generator).start
                                                       : read_window_problem(arguments.file);
  if (!arguments.dump.empty()) {
    std::ofstream out(arguments.dump);
    write_window_problem(out, problem);
    if (!out) throw std::runtime_error(arguments.dump + ": cannot be written");
  }
  std::printf("%zu poses, %zu points, %zu observations, %zu pose-pose constraints\n", problem.poses.size(),
              problem.points.size(), problem.observations.size(), problem.constraints.size());
  print_race(race(problem, arguments.race), 0.001);
}

}  // namespace
}  // namespace twofold

int main(int argc, char** argv) {
  twofold::Arguments arguments;
  auto& g = arguments.generator;
  CLI::App app("Double-window problem: this project's solver beside Ceres");
  app.option_defaults()->always_capture_default();
  app.add_option("--load,file", arguments.file,
                 "Problem written by --dump or window_from_run; none: a generated one");
  app.add_option("--inner", g.inner, "Generated: keyframes of the inner window");
  app.add_option("--outer", g.outer, "Generated: keyframes of the outer window");
  app.add_option("--points", g.points_per_keyframe, "Generated: points a keyframe");
  app.add_option("--outer-observations", g.outer_observations, "Generated: outer keyframes observe points");
  app.add_option("--seed", g.seed, "Generated: seed");
  app.add_option("--outliers", g.outliers, "Generated: share of wrong matches");
  app.add_option("--pose-noise", g.start_pose_noise, "Generated: start poses [m]");
  app.add_option("--depth-noise", g.start_depth_noise, "Generated: start inverse depths, relative");
  app.add_option("--dump", arguments.dump, "Write the problem to this file");
  app.add_option("--huber", arguments.race.solver.huber_sigmas,
                 "Kernel on whitened reprojection errors [standard deviations]");
  app.add_option("--repeat", arguments.race.repeat, "Runs of which the fastest counts")
      ->check(CLI::PositiveNumber);
  CLI11_PARSE(app, argc, argv);
  try {
    twofold::run(arguments);
  } catch (const std::exception& error) {
    std::fprintf(stderr, "window: %s\n", error.what());
    return 2;
  }
}
