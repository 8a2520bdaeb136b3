// bench/bundle_adjustment FILE: a bundle adjustment problem (BAL, libmv text, or a folder of stereo tracks)
// by WindowSolver and by Ceres, poses and points free, intrinsics fixed.
#include <CLI/CLI.hpp>
#include <cmath>
#include <cstdio>
#include <random>

#include "bench/estimation/solver_race.hpp"
#include "fixtures/files/bundle_files.hpp"

namespace twofold {
namespace {

void perturb_points(WindowProblem& problem, double share) {
  std::mt19937 rng(1);
  std::normal_distribution<double> normal;
  for (auto& point : problem.points) point.psi.z() *= std::exp(share * normal(rng));
}

}  // namespace
}  // namespace twofold

int main(int argc, char** argv) {
  std::string path;
  double perturb = 0;
  twofold::RaceOptions options;
  options.solver.huber_sigmas = 0;
  options.euclidean = true;
  options.repeat = 1;
  CLI::App app("Bundle adjustment: this project's solver beside Ceres");
  app.option_defaults()->always_capture_default();
  app.add_option("file", path, "Problem to solve: a file, or a folder of stereo tracks")->required();
  app.add_option("--huber", options.solver.huber_sigmas,
                 "Kernel on whitened reprojection errors [standard deviations]; 0: none");
  app.add_option("--iterations", options.max_iterations, "Iterations at most");
  app.add_option("--repeat", options.repeat, "Runs of which the fastest counts")->check(CLI::PositiveNumber);
  app.add_option("--perturb", perturb,
                 "Relative noise put on the points' start depths, for files that hold a solution");
  CLI11_PARSE(app, argc, argv);
  try {
    twofold::WindowProblem problem = twofold::read_bundle(path);
    if (perturb > 0) twofold::perturb_points(problem, perturb);
    std::printf("%zu cameras, %zu points, %zu observations\n", problem.poses.size(), problem.points.size(),
                problem.observations.size());
    twofold::print_race(twofold::race(problem, options), 0.01);
  } catch (const std::exception& error) {
    std::fprintf(stderr, "bundle_adjustment: %s\n", error.what());
    return 2;
  }
}
