#include "estimation/window_solver.hpp"

#include <utility>

#include "base/check.hpp"
#include "estimation/minimise.hpp"
#include "estimation/reduced_system.hpp"

namespace twofold {

struct WindowSolver::Workspace {
  ReducedSystem system;
  WindowState state, candidate;

  SolverSummary solve(WindowProblem& problem, const WindowSolverOptions& options);
  void write_back(WindowProblem& problem) const;
};

SolverSummary WindowSolver::Workspace::solve(WindowProblem& problem, const WindowSolverOptions& options) {
  state = system.start(problem);
  if (system.factor().size() == 0 && system.layout().tracks().empty()) return {};
  const auto try_step = [&](double lambda, double cost) -> TrialStep {
    system.build(problem, options, state, lambda);
    if (!system.factorise()) return {};
    return judge_step(system.advance(problem, state, lambda, candidate), cost, [&] {
      return window_state_cost(problem, system.layout(), options, state.psi, candidate);
    });
  };
  const double cost = window_state_cost(problem, system.layout(), options, state.psi, state);
  const SolverSummary summary = minimise(cost, options, try_step, [&] { std::swap(state, candidate); });
  if (summary.accepted_steps > 0) write_back(problem);
  return summary;
}

void WindowSolver::Workspace::write_back(WindowProblem& problem) const {
  for (std::size_t i = 0; i < problem.poses.size(); ++i) {
    if (system.layout().position(static_cast<int>(i)) >= 0) problem.poses[i].T_k_w = state.poses[i];
  }
  for (std::size_t k = 0; k < state.psi.size(); ++k) {
    problem.points[system.layout().tracks()[k].point].psi = state.psi[k];
  }
}

WindowSolver::WindowSolver() : workspace_(std::make_unique<Workspace>()) {}
WindowSolver::~WindowSolver() = default;
WindowSolver::WindowSolver(WindowSolver&&) noexcept = default;
WindowSolver& WindowSolver::operator=(WindowSolver&&) noexcept = default;

SolverSummary WindowSolver::solve(WindowProblem& problem, const WindowSolverOptions& options) {
  TWOFOLD_CHECK(invalid_reason(problem).empty(), "window problem");
  return workspace_->solve(problem, options);
}

}  // namespace twofold
