#include "estimation/window_solver.hpp"

#include <utility>

#include "estimation/levenberg_marquardt.hpp"
#include "estimation/reduced_system.hpp"
#include "geometry/check.hpp"

namespace twofold {

struct WindowSolver::Workspace {
  ReducedSystem system;
  WindowState state, candidate;

  enum class Outcome { kRefused, kAccepted, kAtMinimum };
  struct Trial {
    Outcome outcome = Outcome::kRefused;
    double cost = 0;
    double gain = 0;  ///< decrease over the decrease the quadratic model promised
  };
  Trial try_step(const WindowProblem& problem, const WindowSolverOptions& options, double lambda,
                 double cost);
  SolverSummary minimise(const WindowProblem& problem, const WindowSolverOptions& options);
  void write_back(WindowProblem& problem) const;
};

/// One step from state to candidate.
WindowSolver::Workspace::Trial WindowSolver::Workspace::try_step(const WindowProblem& problem,
                                                                 const WindowSolverOptions& options,
                                                                 double lambda, double cost) {
  system.build(problem, options, state, lambda);
  if (!system.factorise()) return {};
  const auto predicted = system.step(state, lambda, candidate);
  if (!predicted) return {};
  // Of such a step rounding decides whether it goes up or down.
  if (*predicted <= 1e-15 * cost) return {Outcome::kAtMinimum, cost, 1};
  const double new_cost = window_state_cost(problem, system.layout(), options, state.psi, candidate);
  if (!(new_cost < cost)) return {};
  return {Outcome::kAccepted, new_cost, (cost - new_cost) / *predicted};
}

SolverSummary WindowSolver::Workspace::minimise(const WindowProblem& problem,
                                                const WindowSolverOptions& options) {
  using Termination = SolverSummary::Termination;
  SolverSummary summary;
  double cost = window_state_cost(problem, system.layout(), options, state.psi, state);
  summary.initial_cost = cost;
  summary.termination = Termination::kIterationLimit;
  LevenbergMarquardtDamping damping(options.initial_damping);
  bool go_on = true;
  while (go_on && summary.iterations < options.max_iterations && !damping.exhausted()) {
    ++summary.iterations;
    const auto [outcome, new_cost, gain] = try_step(problem, options, damping.lambda(), cost);
    if (outcome == Outcome::kAtMinimum) {
      summary.termination = Termination::kConverged;
      go_on = false;
    } else if (outcome == Outcome::kRefused) {
      damping.reject();
    } else {
      std::swap(state, candidate);
      const double decrease = cost - new_cost;
      cost = new_cost;
      ++summary.accepted_steps;
      damping.accept(gain);
      if (decrease < options.relative_decrease * cost) {
        summary.termination = Termination::kConverged;
        go_on = false;
      }
    }
    if (options.keep_going && !options.keep_going(summary.iterations, cost)) go_on = false;
  }
  if (summary.accepted_steps == 0 && summary.termination != Termination::kConverged) {
    summary.termination = Termination::kNoStepFound;
  }
  summary.final_cost = cost;
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
  workspace_->state = workspace_->system.start(problem);
  const WindowLayout& layout = workspace_->system.layout();
  if (workspace_->system.factor().size() == 0 && layout.tracks().empty()) return {};
  const SolverSummary summary = workspace_->minimise(problem, options);
  if (summary.accepted_steps > 0) workspace_->write_back(problem);
  return summary;
}

}  // namespace twofold
