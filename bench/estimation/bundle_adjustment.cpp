// bench/bundle_adjustment FILE: a bundle adjustment problem (BAL, libmv text, or a folder of stereo tracks)
// by WindowSolver and by Ceres, poses and points free, intrinsics held.
#include <CLI/CLI.hpp>
#include <cstdio>

#include "bench/estimation/bundle_files.hpp"
#include "bench/estimation/solver_race.hpp"

int main(int argc, char** argv) {
  std::string path;
  twofold::RaceOptions options;
  options.solver.huber_px = 0;
  options.euclidean = true;
  options.repeat = 1;
  CLI::App app("Bundle adjustment: this project's solver beside Ceres");
  app.option_defaults()->always_capture_default();
  app.add_option("file", path, "Problem to solve: a file, or a folder of stereo tracks")->required();
  app.add_option("--huber", options.solver.huber_px, "Kernel on reprojection errors [px]; 0: none");
  app.add_option("--iterations", options.max_iterations, "Iterations at most");
  app.add_option("--repeat", options.repeat, "Runs of which the fastest counts")->check(CLI::PositiveNumber);
  CLI11_PARSE(app, argc, argv);
  try {
    const twofold::WindowProblem problem = twofold::read_bundle(path);
    std::printf("%zu cameras, %zu points, %zu observations\n", problem.poses.size(), problem.points.size(),
                problem.observations.size());
    twofold::print_race(twofold::race(problem, options), 0.01);
  } catch (const std::exception& error) {
    std::fprintf(stderr, "bundle_adjustment: %s\n", error.what());
    return 2;
  }
}
