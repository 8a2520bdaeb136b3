#pragma once

#include <optional>
#include <string>
#include <vector>

#include "estimation/window_problem.hpp"

namespace twofold {

/// How a solver came down: cost after each iteration (entry 0: the start) and the time since it was called.
struct SolverCourse {
  std::string name;
  double set_up_ms = 0;  ///< building the solver's own problem: not part of the times
  std::vector<double> ms;
  std::vector<double> cost;  ///< never rises: the best so far
  double peak_memory_mib = 0;

  [[nodiscard]] std::optional<std::size_t> reached(double limit) const;
};

struct RaceOptions {
  WindowSolverOptions solver;  ///< of this project's solver; kernels and damping also those of Ceres
  int max_iterations = 50;
  int repeat = 3;          ///< the fastest of so many runs counts
  bool euclidean = false;  ///< run Ceres also with Euclidean points in the world
};

/// Solves the problem by WindowSolver (by PoseElimination, where that is cheaper) and by Ceres with each of
/// its Schur solvers: same start, same kernels, analytic Jacobians, one thread each. Each in a process of its
/// own, so that its memory can be told.
[[nodiscard]] std::vector<SolverCourse> race(const WindowProblem& problem, const RaceOptions& options);

/// Table of when each came within `share` of the best cost any of them reached.
void print_race(const std::vector<SolverCourse>& courses, double share);

}  // namespace twofold
