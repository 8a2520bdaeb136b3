#pragma once

#include <memory>

#include "estimation/window_problem.hpp"

namespace twofold {

/// Levenberg-Marquardt on a WindowProblem. Points are eliminated point track by point track (thesis 3.3.5),
/// the block sparse reduced camera system is factorised by CHOLMOD, whose symbolic analysis is kept while the
/// structure stays. Buffers are kept between calls. One instance a thread. Deterministic.
class WindowSolver {
 public:
  WindowSolver();
  ~WindowSolver();
  WindowSolver(WindowSolver&&) noexcept;
  WindowSolver& operator=(WindowSolver&&) noexcept;

  /// Changes problem.poses and problem.points; the cost never rises. If no step lowers it they stay as they
  /// were.
  SolverSummary solve(WindowProblem& problem, const WindowSolverOptions& options);

 private:
  struct Workspace;
  std::unique_ptr<Workspace> workspace_;
};

/// Optimises each point alone with all poses held (thesis 6.2.3: "a few iterations of structure-only BA").
/// Points that do not improve stay as they were.
void optimise_structure(WindowProblem& problem, const WindowSolverOptions& options);

}  // namespace twofold
