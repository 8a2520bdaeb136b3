#pragma once

#include <memory>

#include "estimation/window_problem.hpp"

namespace twofold {

/// Levenberg-Marquardt on a WindowProblem. Points are eliminated point track by point track (thesis 3.3.5),
/// anchor by anchor (see WindowLayout); the block sparse reduced camera system is factorised by
/// BlockCholesky, which keeps order and pattern while the structure stays. Buffers are kept between calls.
/// One instance a thread; starts no threads. Deterministic.
///
/// Observations behind their camera at the start are left out of the whole solve; a step that brings another
/// one behind its camera is refused. Poses that no observation or constraint ties to anything stay as they
/// are.
class WindowSolver {
 public:
  WindowSolver();
  ~WindowSolver();
  WindowSolver(WindowSolver&&) noexcept;
  WindowSolver& operator=(WindowSolver&&) noexcept;

  /// Changes problem.poses and problem.points; the cost never rises. If no step lowers it they stay as they
  /// were. The problem must be valid (see invalid_reason).
  SolverSummary solve(WindowProblem& problem, const WindowSolverOptions& options);

 private:
  struct Workspace;
  std::unique_ptr<Workspace> workspace_;
};

/// Optimises each point alone with all poses fixed (thesis 6.2.3: "a few iterations of structure-only BA").
/// Points that do not improve stay as they were.
void optimise_structure(WindowProblem& problem, const WindowSolverOptions& options);

}  // namespace twofold
