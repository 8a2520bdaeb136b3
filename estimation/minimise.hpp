#pragma once

#include <optional>

#include "estimation/levenberg_marquardt.hpp"
#include "estimation/window_problem.hpp"

namespace twofold {

/// What became of one step of an iteration.
struct TrialStep {
  enum class Outcome { kRefused, kAccepted, kAtMinimum };
  Outcome outcome = Outcome::kRefused;
  double cost = 0;
  double gain = 0;  ///< decrease over the decrease the quadratic model promised
};

/// @param predicted          decrease the quadratic model promises; none when there is no step
/// @param cost_of_candidate  asked for only when the promised decrease is more than rounding
template <class Cost>
[[nodiscard]] TrialStep judge_step(std::optional<double> predicted, double cost, Cost&& cost_of_candidate) {
  if (!predicted) return {};
  // Of such a step rounding decides whether it goes up or down.
  if (*predicted <= 1e-15 * cost) return {TrialStep::Outcome::kAtMinimum, cost, 1};
  const double new_cost = cost_of_candidate();
  if (!(new_cost < cost)) return {};
  return {TrialStep::Outcome::kAccepted, new_cost, (cost - new_cost) / *predicted};
}

/// Levenberg-Marquardt: the iteration that window solvers share.
///
/// @param cost      of the present values
/// @param try_step  (lambda, cost) -> TrialStep: from the present values to candidates
/// @param accept    makes the candidates the present values
template <class TryStep, class Accept>
[[nodiscard]] SolverSummary minimise(double cost, const WindowSolverOptions& options, TryStep&& try_step,
                                     Accept&& accept) {
  using Termination = SolverSummary::Termination;
  SolverSummary summary;
  summary.initial_cost = cost;
  summary.termination = Termination::kIterationLimit;
  LevenbergMarquardtDamping damping(options.initial_damping);
  bool go_on = true;
  while (go_on && summary.iterations < options.max_iterations && !damping.exhausted()) {
    ++summary.iterations;
    const auto [outcome, new_cost, gain] = try_step(damping.lambda(), cost);
    if (outcome == TrialStep::Outcome::kAtMinimum) {
      summary.termination = Termination::kConverged;
      go_on = false;
    } else if (outcome == TrialStep::Outcome::kRefused) {
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

}  // namespace twofold
