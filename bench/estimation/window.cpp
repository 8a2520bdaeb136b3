// bench/window [FILE]: one double-window problem (eq. 6.4), solved by WindowSolver and by Ceres with each of
// its Schur solvers: same start, same kernels, analytic Jacobians on both sides, one thread each. Prints the
// time until the cost is within 0.1 % of the best cost any of them reaches.
#include <CLI/CLI.hpp>
#include <chrono>
#include <cstdio>
#include <fstream>
#include <limits>
#include <optional>

#include "estimation/window_problem_io.hpp"
#include "estimation/window_solver.hpp"
#include "tests/estimation/ceres_window.hpp"
#include "tests/estimation/synthetic_window.hpp"

// OpenBLAS, if that is the BLAS behind Ceres' dense kernels, would otherwise take every core.
extern "C" void openblas_set_num_threads(int) __attribute__((weak));

namespace twofold {
namespace {

struct Arguments {
  std::string file;
  std::string dump;
  SyntheticWindowOptions generator;
  WindowSolverOptions solver;
  int repeat = 5;
  int max_iterations = 50;
};

/// Cost after each iteration and the time it was reached at, from the call of the solver.
struct Course {
  std::string name;
  double set_up_ms = 0;  ///< building the solver's problem, not part of the times below
  std::vector<double> ms;
  std::vector<double> cost;

  [[nodiscard]] std::optional<std::size_t> reached(double limit) const {
    for (std::size_t n = 0; n < cost.size(); ++n) {
      if (cost[n] <= limit) return n;
    }
    return std::nullopt;
  }
};

double milliseconds_since(std::chrono::steady_clock::time_point begin) {
  return std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - begin).count();
}

/// Solves from the start with 1, 2, 3, ... iterations: each time is that of a whole call.
Course run_twofold(const WindowProblem& start, const Arguments& arguments) {
  Course course{"twofold", 0, {0}, {window_cost(start, arguments.solver)}};
  for (int n = 1; n <= arguments.max_iterations; ++n) {
    WindowSolverOptions options = arguments.solver;
    options.max_iterations = n;
    options.relative_decrease = 1e-9;
    double best = std::numeric_limits<double>::infinity();
    SolverSummary summary;
    for (int r = 0; r < arguments.repeat; ++r) {
      WindowProblem problem = start;
      WindowSolver solver;  // a new one: the first call has everything to analyse
      const auto begin = std::chrono::steady_clock::now();
      summary = solver.solve(problem, options);
      best = std::min(best, milliseconds_since(begin));
    }
    course.ms.push_back(best);
    course.cost.push_back(summary.final_cost);
    if (summary.iterations < n || summary.termination == SolverSummary::Termination::kConverged) break;
  }
  return course;
}

Course run_ceres(const char* name, ceres::LinearSolverType type, const WindowProblem& start,
                 const Arguments& arguments) {
  Course course{name, 0, {}, {}};
  for (int r = 0; r < arguments.repeat; ++r) {
    auto begin = std::chrono::steady_clock::now();
    CeresWindow window(start, arguments.solver);
    const double set_up_ms = milliseconds_since(begin);
    ceres::Solver::Options options;
    options.linear_solver_type = type;
    options.preconditioner_type = ceres::SCHUR_JACOBI;
    options.initial_trust_region_radius = 1 / arguments.solver.initial_damping;
    options.max_num_iterations = arguments.max_iterations;
    options.function_tolerance = 1e-9;
    options.logging_type = ceres::SILENT;
    const auto summary = window.solve(options);
    std::vector<double> ms, cost;
    for (const auto& iteration : summary.iterations) {
      ms.push_back(1e3 * iteration.cumulative_time_in_seconds);
      const double own = 2 * iteration.cost;  // of a refused step: what it would have cost
      cost.push_back(cost.empty() ? own : std::min(cost.back(), own));
    }
    if (r == 0) course.cost = cost, course.ms = ms, course.set_up_ms = set_up_ms;
    course.set_up_ms = std::min(course.set_up_ms, set_up_ms);
    for (std::size_t n = 0; n < std::min(ms.size(), course.ms.size()); ++n) {
      course.ms[n] = std::min(course.ms[n], ms[n]);
    }
  }
  return course;
}

void print(const std::vector<Course>& courses) {
  double best = std::numeric_limits<double>::infinity();
  for (const Course& course : courses) best = std::min(best, course.cost.back());
  const double limit = 1.001 * best;
  std::printf("best cost %.6f\n\n", best);
  std::printf("%-24s %10s %14s %14s %12s %12s %12s %9s\n", "solver", "set-up ms", "cost after 3",
              "final cost", "ms for 3", "iterations", "ms to 0.1 %", "relative");
  const auto own = courses.front().reached(limit);
  for (const Course& course : courses) {
    const std::size_t third = std::min<std::size_t>(3, course.cost.size() - 1);
    std::printf("%-24s %10.2f %14.4f %14.4f %12.2f", course.name.c_str(), course.set_up_ms,
                course.cost[third], course.cost.back(), course.ms[third]);
    if (const auto n = course.reached(limit); n && own) {
      std::printf(" %12zu %12.2f %8.2fx\n", *n, course.ms[*n], course.ms[*n] / courses.front().ms[*own]);
    } else {
      std::printf(" %12s %12s %9s\n", "-", "-", "-");
    }
  }
}

int run(const Arguments& arguments) {
  if (openblas_set_num_threads != nullptr) openblas_set_num_threads(1);
  const WindowProblem problem = arguments.file.empty() ? make_synthetic_window(arguments.generator).start
                                                       : read_window_problem(arguments.file);
  if (!arguments.dump.empty()) {
    std::ofstream out(arguments.dump);
    write_window_problem(out, problem);
    if (!out) throw std::runtime_error(arguments.dump + ": cannot be written");
  }
  std::printf("%zu poses, %zu points, %zu observations, %zu pose-pose constraints\n", problem.poses.size(),
              problem.points.size(), problem.observations.size(), problem.constraints.size());
  std::vector<Course> courses{run_twofold(problem, arguments)};
  courses.push_back(run_ceres("ceres SPARSE_SCHUR", ceres::SPARSE_SCHUR, problem, arguments));
  courses.push_back(run_ceres("ceres DENSE_SCHUR", ceres::DENSE_SCHUR, problem, arguments));
  courses.push_back(run_ceres("ceres ITERATIVE_SCHUR", ceres::ITERATIVE_SCHUR, problem, arguments));
  print(courses);
  return 0;
}

}  // namespace
}  // namespace twofold

int main(int argc, char** argv) {
  twofold::Arguments arguments;
  auto& g = arguments.generator;
  g = {.inner = 25, .outer = 175, .laps = 1.6, .spacing = 0.25, .points_per_keyframe = 70};
  g.pixel_noise = 0.7;
  g.outliers = 0.03;
  g.missing_right = 0.2;
  g.constraint_noise = 0.005;
  g.start_pose_noise = 0.01;
  g.start_depth_noise = 0.05;
  CLI::App app("Double-window problem: this project's solver beside Ceres");
  app.add_option("file", arguments.file, "Window problem to solve; none: a generated one");
  app.add_option("--inner", g.inner, "Generated: keyframes of the inner window")->capture_default_str();
  app.add_option("--outer", g.outer, "Generated: keyframes of the outer window")->capture_default_str();
  app.add_option("--points", g.points_per_keyframe, "Generated: landmarks a keyframe")->capture_default_str();
  app.add_option("--outer-observations", g.outer_observations, "Generated: outer keyframes observe points");
  app.add_option("--seed", g.seed, "Generated: seed")->capture_default_str();
  app.add_option("--pose-noise", g.start_pose_noise, "Generated: start poses [m]")->capture_default_str();
  app.add_option("--depth-noise", g.start_depth_noise, "Generated: start inverse depths, relative")
      ->capture_default_str();
  app.add_option("--dump", arguments.dump, "Write the problem to this file");
  app.add_option("--huber", arguments.solver.huber_px, "Kernel on reprojection errors [px]")
      ->capture_default_str();
  app.add_option("--repeat", arguments.repeat, "Runs of which the fastest counts")
      ->check(CLI::PositiveNumber)
      ->capture_default_str();
  CLI11_PARSE(app, argc, argv);
  try {
    return twofold::run(arguments);
  } catch (const std::exception& error) {
    std::fprintf(stderr, "window: %s\n", error.what());
    return 2;
  }
}
