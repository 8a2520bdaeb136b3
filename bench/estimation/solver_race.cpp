#include "bench/estimation/solver_race.hpp"

#include <malloc.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <chrono>
#include <cstdio>
#include <functional>
#include <limits>
#include <sstream>
#include <stdexcept>

#include "bench/estimation/ceres_euclidean.hpp"
#include "bench/estimation/pose_elimination.hpp"
#include "estimation/window_solver.hpp"

// OpenBLAS, if that is the BLAS behind Ceres' dense kernels, would otherwise take every core.
extern "C" void openblas_set_num_threads(int) __attribute__((weak));

namespace twofold {
namespace {

using Clock = std::chrono::steady_clock;

double milliseconds_since(Clock::time_point begin) {
  return std::chrono::duration<double, std::milli>(Clock::now() - begin).count();
}

void keep_fastest(SolverCourse& best, const SolverCourse& run) {
  if (best.cost.empty()) {
    best = run;
    return;
  }
  best.set_up_ms = std::min(best.set_up_ms, run.set_up_ms);
  for (std::size_t n = 0; n < std::min(best.ms.size(), run.ms.size()); ++n) {
    best.ms[n] = std::min(best.ms[n], run.ms[n]);
  }
}

SolverCourse run_twofold(const WindowProblem& start, const RaceOptions& race) {
  SolverCourse course;
  course.ms = {0};
  course.cost = {window_cost(start, race.solver)};
  WindowProblem problem = start;
  WindowSolver solver;  // a new one each time: it has everything to analyse
  WindowSolverOptions options = race.solver;
  options.max_iterations = race.max_iterations;
  options.relative_decrease = 1e-9;
  const auto begin = Clock::now();
  options.keep_going = [&](int, double cost) {
    course.ms.push_back(milliseconds_since(begin));
    course.cost.push_back(cost);
    return true;
  };
  if (PoseElimination::is_cheaper(problem)) {
    (void)PoseElimination().solve(problem, options);
  } else {
    (void)solver.solve(problem, options);
  }
  course.ms.back() = milliseconds_since(begin);  // with writing back
  return course;
}

template <class CeresProblem>
SolverCourse run_ceres(ceres::LinearSolverType type, const WindowProblem& start, const RaceOptions& race) {
  SolverCourse course;
  const auto begin = Clock::now();
  CeresProblem problem(start, race.solver);
  course.set_up_ms = milliseconds_since(begin);
  ceres::Solver::Options options;
  options.linear_solver_type = type;
  options.preconditioner_type = ceres::SCHUR_JACOBI;
  options.initial_trust_region_radius = 1 / race.solver.initial_damping;
  options.max_num_iterations = race.max_iterations;
  options.function_tolerance = 1e-9;
  options.logging_type = ceres::SILENT;
  for (const auto& iteration : problem.solve(options).iterations) {
    course.ms.push_back(1e3 * iteration.cumulative_time_in_seconds);
    const double cost = 2 * iteration.cost;  // of a refused step: what it would have cost
    course.cost.push_back(course.cost.empty() ? cost : std::min(course.cost.back(), cost));
  }
  return course;
}

std::string to_text(const SolverCourse& course) {
  std::ostringstream out;
  out.precision(17);
  out << course.set_up_ms << ' ' << course.cost.size();
  for (std::size_t n = 0; n < course.cost.size(); ++n) out << ' ' << course.ms[n] << ' ' << course.cost[n];
  return out.str();
}

SolverCourse from_text(const std::string& text) {
  SolverCourse course;
  std::istringstream in(text);
  std::size_t count = 0;
  in >> course.set_up_ms >> count;
  course.ms.resize(count);
  course.cost.resize(count);
  for (std::size_t n = 0; n < count; ++n) in >> course.ms[n] >> course.cost[n];
  return course;
}

/// Runs in a child process; the course comes back through a pipe, the peak memory from the kernel.
SolverCourse in_own_process(const std::string& name, const std::function<SolverCourse()>& run) {
  int pipe_ends[2];
  if (pipe(pipe_ends) != 0) throw std::runtime_error("no pipe");
  std::fflush(stdout);
  const pid_t child = fork();
  if (child < 0) throw std::runtime_error("no process");
  if (child == 0) {
    close(pipe_ends[0]);
    // What a run gives back stays with the process: pages new from the kernel are no matter of solvers, and
    // whether a run gets some would hang on the sizes of its pieces.
    mallopt(M_MMAP_THRESHOLD, 32 << 20);
    mallopt(M_TRIM_THRESHOLD, 1 << 30);
    const std::string text = to_text(run());
    const bool written = write(pipe_ends[1], text.data(), text.size()) == static_cast<ssize_t>(text.size());
    _exit(written ? 0 : 1);
  }
  close(pipe_ends[1]);
  std::string text;
  char buffer[4096];
  for (ssize_t n; (n = read(pipe_ends[0], buffer, sizeof buffer)) > 0;) text.append(buffer, n);
  close(pipe_ends[0]);
  int status = 0;
  rusage usage{};
  wait4(child, &status, 0, &usage);
  if (status != 0) throw std::runtime_error(name + " did not come to an end");
  SolverCourse course = from_text(text);
  course.name = name;
  course.peak_memory_mib = static_cast<double>(usage.ru_maxrss) / 1024;
  return course;
}

}  // namespace

std::optional<std::size_t> SolverCourse::reached(double limit) const {
  for (std::size_t n = 0; n < cost.size(); ++n) {
    if (cost[n] <= limit) return n;
  }
  return std::nullopt;
}

std::vector<SolverCourse> race(const WindowProblem& problem, const RaceOptions& options) {
  if (openblas_set_num_threads != nullptr) openblas_set_num_threads(1);
  std::vector<SolverCourse> courses;
  const auto add = [&](const std::string& name, const std::function<SolverCourse()>& run) {
    courses.push_back(in_own_process(name, [&] {
      SolverCourse best;
      for (int n = 0; n < options.repeat; ++n) keep_fastest(best, run());
      return best;
    }));
  };
  add("twofold", [&] { return run_twofold(problem, options); });
  const std::pair<const char*, ceres::LinearSolverType> types[] = {
      {"SPARSE_SCHUR", ceres::SPARSE_SCHUR},
      {"DENSE_SCHUR", ceres::DENSE_SCHUR},
      {"ITERATIVE_SCHUR", ceres::ITERATIVE_SCHUR}};
  for (const auto& [name, type] : types) {
    add(std::string("ceres ") + name, [&, t = type] { return run_ceres<CeresWindow>(t, problem, options); });
    if (!options.euclidean) continue;
    add(std::string("ceres XYZ ") + name,
        [&, t = type] { return run_ceres<CeresEuclidean>(t, problem, options); });
  }
  return courses;
}

void print_race(const std::vector<SolverCourse>& courses, double share) {
  double best = std::numeric_limits<double>::infinity();
  for (const SolverCourse& course : courses) best = std::min(best, course.cost.back());
  std::printf("initial cost %.6f, best final cost %.6f; times to within %g %% of it\n\n",
              courses.front().cost.front(), best, 100 * share);
  std::printf("%-27s %9s %14s %16s %10s %6s %6s %10s %8s %8s\n", "solver", "set-up ms", "cost after 3",
              "final cost", "ms for 3", "iters", "needed", "ms needed", "ratio", "MiB");
  const SolverCourse& own = courses.front();
  const auto own_reached = own.reached((1 + share) * best);
  for (const SolverCourse& course : courses) {
    const std::size_t third = std::min<std::size_t>(3, course.cost.size() - 1);
    std::printf("%-27s %9.2f %14.4f %16.6f %10.2f %6zu", course.name.c_str(), course.set_up_ms,
                course.cost[third], course.cost.back(), course.ms[third], course.cost.size() - 1);
    if (const auto n = course.reached((1 + share) * best)) {
      std::printf(" %6zu %10.2f", *n, course.ms[*n]);
      // A start that is good enough needs no solver: then there is nothing to compare.
      if (own_reached && own.ms[*own_reached] > 0) {
        std::printf(" %7.2fx", course.ms[*n] / own.ms[*own_reached]);
      } else {
        std::printf(" %8s", "-");
      }
    } else {
      std::printf(" %6s %10s %8s", "-", "never", "-");
    }
    std::printf(" %8.1f\n", course.peak_memory_mib);
  }
}

}  // namespace twofold
