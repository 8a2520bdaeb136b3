// bench/window: one double-window problem (eq. 6.4) by WindowSolver and by Ceres. It is taken out of a run of
// the engine, read from a file, or generated.
#include <CLI/CLI.hpp>
#include <cstdio>
#include <fstream>

#include "bench/estimation/solver_race.hpp"
#include "bench/estimation/window_from_run.hpp"
#include "estimation/window_problem_io.hpp"
#include "tests/estimation/synthetic_window.hpp"

namespace twofold {
namespace {

struct Arguments {
  std::string file;
  std::string dump;
  RunOptions run;
  SyntheticWindowOptions generator;
  RaceOptions race;
};

WindowProblem problem_of_run(const RunOptions& options) {
  RunProblem taken = window_from_run(options);
  std::printf("%s: round %d of %d, windows %d/%d\n", options.source.c_str(), taken.round, taken.rounds,
              options.inner, options.outer);
  return std::move(taken.problem);
}

WindowProblem problem_of(const Arguments& arguments) {
  if (!arguments.file.empty()) return read_window_problem(arguments.file);
  if (!arguments.run.source.empty()) return problem_of_run(arguments.run);
  SyntheticWindowOptions generator = arguments.generator;
  generator.inner = arguments.run.inner;
  generator.outer = arguments.run.outer;
  return make_synthetic_window(generator).start;
}

void run(const Arguments& arguments) {
  const WindowProblem problem = problem_of(arguments);
  if (!arguments.dump.empty()) {
    std::ofstream out(arguments.dump);
    write_window_problem(out, problem);
    out.flush();
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
  g.laps = 1.6;
  g.points_per_keyframe = 70;
  g.pixel_noise = 0.7;
  g.outliers = 0.03;
  g.missing_right = 0.2;
  g.constraint_noise = 0.005;
  g.start_pose_noise = 0.01;
  g.start_depth_noise = 0.05;
  CLI::App app("Double-window problem: this project's solver beside Ceres");
  app.option_defaults()->always_capture_default();
  auto* source =
      app.add_option("--run", arguments.run.source,
                     "Source of frames to run the engine over: the problem is one of its mapper's");
  app.add_option("--load,file", arguments.file,
                 "Problem that --dump wrote; without it and --run, a generated one")
      ->excludes(source);
  app.add_option("--dump", arguments.dump, "Write the problem to this file");
  app.add_option("--inner", arguments.run.inner, "Keyframes of the inner window")->check(CLI::PositiveNumber);
  app.add_option("--outer", arguments.run.outer, "Keyframes of the outer window")
      ->check(CLI::NonNegativeNumber);
  app.add_option("--round", arguments.run.round,
                 "--run: round of the mapper to take, from 1; 0: the last with the most poses")
      ->check(CLI::NonNegativeNumber);
  app.add_option("--points", g.points_per_keyframe, "Generated: landmarks a keyframe");
  app.add_option("--outer-observations", g.outer_observations, "Generated: outer keyframes observe points");
  app.add_option("--seed", g.seed, "Generated: seed");
  app.add_option("--outliers", g.outliers, "Generated: share of wrong matches");
  app.add_option("--pose-noise", g.start_pose_noise, "Generated: start poses [m]");
  app.add_option("--depth-noise", g.start_depth_noise, "Generated: start inverse depths, relative");
  app.add_option("--huber", arguments.race.solver.huber_px, "Kernel on reprojection errors [px]");
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
