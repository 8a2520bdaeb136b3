#include "posegraph/pose_graph.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <utility>

#include "base/check.hpp"
#include "base/option_check.hpp"
#include "estimation/levenberg_marquardt.hpp"
#include "estimation/robust_kernel.hpp"
#include "posegraph/pose_graph_equations.hpp"
#include "posegraph/pose_graph_error.hpp"
#include "posegraph/pose_graph_initialisation.hpp"

namespace twofold {

std::string PoseGraphOptions::invalid_reason() const {
  return OptionCheck()
      .at_least("max_iterations", max_iterations, 0)
      .at_least("initial_damping", initial_damping, 0)
      .at_least("relative_decrease", relative_decrease, 0)
      .reason();
}

template <class Group>
double pose_graph_cost(const PoseGraph<Group>& graph, PoseGraphError error, double huber) {
  const HuberKernel kernel{huber};
  double cost = 0;
  for (const auto& c : graph.constraints) {
    const Group E = c.T_j_i * graph.poses[c.i] * graph.poses[c.j].inverse();
    const typename Group::Tangent e = pose_graph_error(E, error);
    cost += kernel.rho(e.dot(c.information * e));
  }
  return cost;
}

template <class Group>
bool chain_constraints(PoseGraph<Group>& graph) {
  std::vector<bool> reached(graph.poses.size(), false);
  if (reached.empty()) return true;
  reached[std::max(graph.origin, 0)] = true;
  for (bool changed = true; changed;) {
    changed = false;
    for (const auto& c : graph.constraints) {
      if (reached[c.i] == reached[c.j]) continue;
      if (reached[c.i]) {
        graph.poses[c.j] = c.T_j_i * graph.poses[c.i];
      } else {
        graph.poses[c.i] = c.T_j_i.inverse() * graph.poses[c.j];
      }
      reached[c.i] = reached[c.j] = changed = true;
    }
  }
  return std::find(reached.begin(), reached.end(), false) == reached.end();
}

template <class Group>
struct PoseGraphSolver<Group>::Workspace {
  struct Trial {
    double cost = std::numeric_limits<double>::infinity();  ///< after the step; the graph's poses are moved
    double promised = std::numeric_limits<double>::infinity();  ///< decrease of the cost by the linear model
  };

  PoseGraphEquations<Group> equations;
  std::vector<Group> before;

  /// A step from graph.poses, kept in `before`, with a factor of its own or the last one. It need not lower
  /// the cost.
  Trial try_step(PoseGraph<Group>& graph, const PoseGraphOptions& options, double cost, bool own_factor,
                 double damping) {
    before = graph.poses;
    Trial trial;
    if (own_factor && !equations.system.factorise(damping)) return trial;
    equations.delta = equations.system.solve(equations.gradient);
    trial.promised = equations.gradient.cwiseProduct(equations.delta).sum();
    // An old factor may overshoot where the curvature has grown: halve. A fresh one is left to the damping.
    const double shortest = own_factor ? 1.0 : 0.25;
    for (double scale = 1; scale >= shortest && !(trial.cost < cost); scale *= 0.5) {
      equations.move(before, scale, graph.poses);
      trial.cost = pose_graph_cost(graph, options.error, options.huber);
    }
    return trial;
  }
};

template <class Group>
PoseGraphSolver<Group>::PoseGraphSolver() : workspace_(std::make_unique<Workspace>()) {}
template <class Group>
PoseGraphSolver<Group>::~PoseGraphSolver() = default;
template <class Group>
PoseGraphSolver<Group>::PoseGraphSolver(PoseGraphSolver&&) noexcept = default;
template <class Group>
PoseGraphSolver<Group>& PoseGraphSolver<Group>::operator=(PoseGraphSolver&&) noexcept = default;

namespace {

/// What only graphs of rigid motions have: positions that are linear given the rotations.
template <class Group>
struct Positions {
  Positions(const PoseGraph<Group>& graph, const PoseGraphOptions& options, const BlockStructure& blocks)
      : structure(blocks), useful(options.resolve_positions) {
    if (options.resolve_positions || options.chordal_start) solver.emplace(graph, structure);
  }

  /// Takes new poses where they cost less than `cost`; returns the lower cost.
  double take_better(PoseGraph<Group>& graph, std::vector<Group> poses, double cost,
                     const PoseGraphOptions& options) {
    std::swap(graph.poses, poses);
    const double new_cost = pose_graph_cost(graph, options.error, options.huber);
    if (new_cost < cost) return new_cost;
    std::swap(graph.poses, poses);
    return cost;
  }
  double chordal(PoseGraph<Group>& graph, double cost, const PoseGraphOptions& options) {
    constexpr double kGoodStart = 4;
    if (!options.chordal_start || cost < kGoodStart * Group::kDof * graph.constraints.size()) return cost;
    return take_better(graph, chordal_initialisation(graph, structure, *solver), cost, options);
  }
  double resolve(PoseGraph<Group>& graph, double cost, const PoseGraphOptions& options) {
    if (!useful) return cost;
    std::vector<Group> poses = graph.poses;
    if (!solver->update(graph, poses)) return cost;
    const double new_cost = take_better(graph, std::move(poses), cost, options);
    useful = new_cost < (1 - kWorthwhile) * cost;
    return new_cost;
  }

  static constexpr double kWorthwhile = 1e-3;  // it stops paying once the steps are short
  const BlockStructure& structure;
  std::optional<PoseGraphPositions<Group>> solver;
  bool useful;
};

template <>
struct Positions<Sim3> {
  Positions(const PoseGraph<Sim3>&, const PoseGraphOptions&, const BlockStructure&) {}
  static double chordal(PoseGraph<Sim3>&, double cost, const PoseGraphOptions&) { return cost; }
  static double resolve(PoseGraph<Sim3>&, double cost, const PoseGraphOptions&) { return cost; }
};

/// How each step is made: with which damping (Levenberg-Marquardt, relative to the diagonal), and whether by
/// the factor of the step before.
class StepControl {
 public:
  /// @param least_damping  0: Gauss-Newton until a step fails
  StepControl(double least_damping, double keep_factor_below)
      : least_(least_damping), damping_(least_damping), keep_factor_below_(keep_factor_below) {}
  [[nodiscard]] double damping() const { return damping_; }
  [[nodiscard]] bool own_factor() const { return own_factor_; }

  /// @param gain      true decrease over the one that the linear model promised
  /// @param decrease  relative to the cost
  void accepted(double gain, double decrease) {
    const bool undamped = damping_ == least_;
    const bool contracts = own_factor_ ? decrease < keep_factor_below_ : decrease < last_decrease_ / 3;
    if (own_factor_) adapt(gain);
    own_factor_ = !(undamped && contracts);
    last_decrease_ = decrease;
  }
  /// Once more with a factor of its own, or else shorter. False when there is nothing left to try.
  [[nodiscard]] bool rejected() {
    if (std::exchange(own_factor_, true)) damping_ = raised_damping(damping_, kFirst);
    return damping_ < kMost;
  }

 private:
  static constexpr double kNone = 1e-9, kFirst = 1e-5, kMost = 1e8;

  void adapt(double gain) {
    if (gain < 0.25) damping_ *= 4;
    if (gain > 0.75) damping_ *= 0.1;
    if (damping_ < kNone) damping_ = least_;
  }

  double least_, damping_, keep_factor_below_;
  bool own_factor_ = true;
  double last_decrease_ = 1;
};

template <class Group>
double least_damping(const PoseGraph<Group>& graph, const PoseGraphOptions& options) {
  constexpr double kOfGauge = 1e-9;
  return graph.origin < 0 ? std::max(options.initial_damping, kOfGauge) : options.initial_damping;
}

}  // namespace

template <class Group>
SolverSummary PoseGraphSolver<Group>::solve(PoseGraph<Group>& graph, const PoseGraphOptions& options) {
  using Termination = SolverSummary::Termination;
  SolverSummary summary;
  if (graph.constraints.empty()) return summary;
  TWOFOLD_CHECK(options.invalid_reason().empty(), "options are valid");
  Workspace& w = *workspace_;
  w.equations.analyse(graph);
  Positions<Group> positions(graph, options, w.equations.structure);
  summary.initial_cost = pose_graph_cost(graph, options.error, options.huber);
  double cost = positions.chordal(graph, summary.initial_cost, options);
  if (options.on_cost) options.on_cost(0, cost);

  StepControl control(least_damping(graph, options), options.keep_factor_below);
  bool linearised = false;
  summary.termination = Termination::kIterationLimit;
  while (summary.iterations < options.max_iterations) {
    if (!std::exchange(linearised, true)) w.equations.linearise(graph, options);
    ++summary.iterations;
    const bool own_factor = control.own_factor();
    const auto [tried_cost, promised] = w.try_step(graph, options, cost, own_factor, control.damping());
    if (!(tried_cost < cost)) {
      graph.poses = w.before;
      const bool converged = own_factor && promised >= 0 && promised < options.relative_decrease * cost;
      if (!converged && control.rejected()) continue;
      summary.termination = converged ? Termination::kConverged : Termination::kNoStepFound;
      break;
    }
    ++summary.accepted_steps;
    linearised = false;
    const double gain = (cost - tried_cost) / promised;
    const double before = std::exchange(cost, positions.resolve(graph, tried_cost, options));
    const double decrease = (before - cost) / before;
    if (options.on_cost) options.on_cost(summary.iterations, cost);
    if (decrease < options.relative_decrease) {
      summary.termination = Termination::kConverged;
      break;
    }
    control.accepted(gain, decrease);
  }
  summary.final_cost = cost;
  return summary;
}

// The program has no planar graphs. SE(2) is here for the published ones that tests and benchmarks solve:
// without it, the solver and its equations would all have to be in headers.
template class PoseGraphSolver<SE2>;
template class PoseGraphSolver<SE3>;
template class PoseGraphSolver<Sim3>;
template double pose_graph_cost(const PoseGraph<SE2>&, PoseGraphError, double);
template double pose_graph_cost(const PoseGraph<SE3>&, PoseGraphError, double);
template double pose_graph_cost(const PoseGraph<Sim3>&, PoseGraphError, double);
template bool chain_constraints(PoseGraph<SE2>&);
template bool chain_constraints(PoseGraph<SE3>&);
template bool chain_constraints(PoseGraph<Sim3>&);

}  // namespace twofold
