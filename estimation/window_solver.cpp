#include "estimation/window_solver.hpp"

#include <utility>

#include "estimation/levenberg_marquardt.hpp"
#include "estimation/pose_elimination.hpp"
#include "estimation/reduced_system.hpp"
#include "geometry/check.hpp"

namespace twofold {

namespace {

struct Trial {
  enum class Outcome { kRefused, kAccepted, kAtMinimum };
  Outcome outcome = Outcome::kRefused;
  double cost = 0;
  double gain = 0;  ///< decrease over the decrease the quadratic model promised
};

/// @param cost_of_candidate  asked for only when the promised decrease is more than rounding
template <class Cost>
Trial judge(std::optional<double> predicted, double cost, Cost&& cost_of_candidate) {
  if (!predicted) return {};
  // Of such a step rounding decides whether it goes up or down.
  if (*predicted <= 1e-15 * cost) return {Trial::Outcome::kAtMinimum, cost, 1};
  const double new_cost = cost_of_candidate();
  if (!(new_cost < cost)) return {};
  return {Trial::Outcome::kAccepted, new_cost, (cost - new_cost) / *predicted};
}

/// @param try_step  (lambda, cost): one step from the present values to candidates
/// @param accept    makes the candidates the present values
template <class TryStep, class Accept>
SolverSummary minimise(double cost, const WindowSolverOptions& options, TryStep&& try_step, Accept&& accept) {
  using Termination = SolverSummary::Termination;
  SolverSummary summary;
  summary.initial_cost = cost;
  summary.termination = Termination::kIterationLimit;
  LevenbergMarquardtDamping damping(options.initial_damping);
  bool go_on = true;
  while (go_on && summary.iterations < options.max_iterations && !damping.exhausted()) {
    ++summary.iterations;
    const auto [outcome, new_cost, gain] = try_step(damping.lambda(), cost);
    if (outcome == Trial::Outcome::kAtMinimum) {
      summary.termination = Termination::kConverged;
      go_on = false;
    } else if (outcome == Trial::Outcome::kRefused) {
      damping.reject();
    } else {
      accept();
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

}  // namespace

struct WindowSolver::Workspace {
  ReducedSystem system;
  WindowState state, candidate;
  PoseElimination pose_elimination;

  SolverSummary points_first(WindowProblem& problem, const WindowSolverOptions& options);
  SolverSummary poses_first(WindowProblem& problem, const WindowSolverOptions& options);
  void write_back(WindowProblem& problem) const;
};

SolverSummary WindowSolver::Workspace::points_first(WindowProblem& problem,
                                                    const WindowSolverOptions& options) {
  state = system.start(problem);
  if (system.factor().size() == 0 && system.layout().tracks().empty()) return {};
  const auto try_step = [&](double lambda, double cost) -> Trial {
    system.build(problem, options, state, lambda);
    if (!system.factorise()) return {};
    return judge(system.advance(problem, state, lambda, candidate), cost,
                 [&] { return window_state_cost(problem, system.layout(), options, state.psi, candidate); });
  };
  const double cost = window_state_cost(problem, system.layout(), options, state.psi, state);
  const SolverSummary summary = minimise(cost, options, try_step, [&] { std::swap(state, candidate); });
  if (summary.accepted_steps > 0) write_back(problem);
  return summary;
}

SolverSummary WindowSolver::Workspace::poses_first(WindowProblem& problem,
                                                   const WindowSolverOptions& options) {
  PoseElimination::Values values = pose_elimination.start(problem), next;
  const auto try_step = [&](double lambda, double cost) {
    return judge(pose_elimination.advance(options, values, lambda, next), cost,
                 [&] { return pose_elimination.cost(options, next); });
  };
  const SolverSummary summary =
      minimise(pose_elimination.cost(options, values), options, try_step, [&] { std::swap(values, next); });
  if (summary.accepted_steps > 0) pose_elimination.write_back(values, problem);
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
  return PoseElimination::is_cheaper(problem) ? workspace_->poses_first(problem, options)
                                              : workspace_->points_first(problem, options);
}

}  // namespace twofold
