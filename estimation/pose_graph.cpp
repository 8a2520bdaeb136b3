#include "estimation/pose_graph.hpp"

#include <algorithm>
#include <cmath>
#include <type_traits>

#include "estimation/cholmod_solver.hpp"
#include "estimation/pose_graph_error.hpp"
#include "estimation/pose_graph_initialisation.hpp"
#include "estimation/robust_kernel.hpp"
#include "geometry/check.hpp"

namespace twofold {

std::string PoseGraphOptions::invalid_reason() const {
  if (max_iterations < 0) return "max_iterations must be >= 0, is " + std::to_string(max_iterations);
  if (!(initial_damping >= 0)) return "initial_damping must be >= 0, is " + std::to_string(initial_damping);
  if (!(relative_decrease >= 0))
    return "relative_decrease must be >= 0, is " + std::to_string(relative_decrease);
  return {};
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
  static constexpr int kDof = Group::kDof;
  using Tangent = typename Group::Tangent;
  using Block = typename Group::AdjointMatrix;

  std::vector<std::pair<int, int>> edges;  ///< of the analysed structure
  int poses = -1;
  std::vector<int> order;
  std::vector<CholmodSolver::Slot> slots;
  CholmodSolver system;
  Eigen::MatrixXd gradient;
  std::vector<Group> trial;

  void analyse(const PoseGraph<Group>& graph) {
    std::vector<std::pair<int, int>> now;
    now.reserve(graph.constraints.size());
    for (const auto& c : graph.constraints) now.emplace_back(c.i, c.j);
    if (poses == static_cast<int>(graph.poses.size()) && now == edges) return;
    edges = std::move(now);
    poses = static_cast<int>(graph.poses.size());
    order = elimination_order(poses, edges);
    slots = system.set_pattern(kDof, order, edges);
  }

  /// Normal equations H delta = -gradient of half the cost at graph.poses.
  void linearise(const PoseGraph<Group>& graph, const PoseGraphOptions& options) {
    const HuberKernel kernel{options.huber};
    system.set_zero();
    gradient.setZero(kDof * poses, 1);
    for (std::size_t k = 0; k < graph.constraints.size(); ++k) {
      const auto& c = graph.constraints[k];
      const Group T_i_j = graph.poses[c.i] * graph.poses[c.j].inverse();
      const Group E = c.T_j_i * T_i_j;
      const Tangent e = pose_graph_error(E, options.error);
      // eq. 5.18; and since exp(y) on T_j acts like exp(-Ad y) on T_i with Ad that of T_i_j, J_j = -J_i Ad
      // (5.19)
      const Block J_i = pose_graph_error_jacobian(E, e, options.error, options.jacobian) * c.T_j_i.adjoint();
      const Block ad = T_i_j.adjoint();
      Block information = c.information;
      if (options.huber > 0) information *= kernel.weight(e.dot(c.information * e));
      const Block W_J = information * J_i;
      const Block H_ii = J_i.transpose() * W_J;
      const Tangent g_i = W_J.transpose() * e;
      const Block H_ij = -H_ii * ad;
      const Block H_jj = -ad.transpose() * H_ij;
      if (c.i != graph.origin) {
        system.add_diagonal<kDof>(c.i, H_ii);
        gradient.template block<kDof, 1>(kDof * c.i, 0) += g_i;
      }
      if (c.j != graph.origin) {
        system.add_diagonal<kDof>(c.j, H_jj);
        gradient.template block<kDof, 1>(kDof * c.j, 0) -= ad.transpose() * g_i;
      }
      if (c.i != graph.origin && c.j != graph.origin) system.add_off_diagonal<kDof>(slots[k], H_ij);
    }
    if (graph.origin >= 0) system.add_diagonal<kDof>(graph.origin, Block::Identity());  // its step is zero
  }

  /// Moves along the step of the last factor; keeps the old poses in `trial`.
  void step(PoseGraph<Group>& graph) {
    const Eigen::MatrixXd delta = system.solve(gradient);
    trial = graph.poses;
    for (int i = 0; i < poses; ++i) {
      graph.poses[i] = Group::exp(-delta.template block<kDof, 1>(kDof * i, 0)) * trial[i];
    }
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

/// Takes the chordal start where its cost is lower; returns the cost.
template <class Group>
double take_better_start(PoseGraph<Group>& graph, const PoseGraphOptions& options,
                         std::span<const int> order) {
  const double cost = pose_graph_cost(graph, options.error, options.huber);
  if constexpr (!std::is_same_v<Group, Sim3>) {
    if (!options.chordal_start) return cost;
    std::vector<Group> given = graph.poses;
    graph.poses = chordal_initialisation(graph, order);
    const double chordal_cost = pose_graph_cost(graph, options.error, options.huber);
    if (chordal_cost < cost || !std::isfinite(cost)) return chordal_cost;
    graph.poses = std::move(given);
  }
  return cost;
}

}  // namespace

template <class Group>
SolverSummary PoseGraphSolver<Group>::solve(PoseGraph<Group>& graph, const PoseGraphOptions& options) {
  constexpr double kMinDamping = 1e-9, kFirstDamping = 1e-5, kMaxDamping = 1e8;
  SolverSummary summary;
  if (graph.constraints.empty()) return summary;
  TWOFOLD_CHECK(options.invalid_reason().empty(), "options are valid");
  Workspace& w = *workspace_;
  w.analyse(graph);
  summary.initial_cost = pose_graph_cost(graph, options.error, options.huber);
  double cost = take_better_start(graph, options, w.order);
  if (options.on_cost) options.on_cost(0, cost);

  const double least_damping =
      graph.origin < 0 ? std::max(options.initial_damping, kMinDamping) : options.initial_damping;
  double damping = least_damping;
  bool keep_factor = false;
  double last_decrease = 1;  // relative
  bool linearised = false;
  summary.termination = SolverSummary::Termination::kIterationLimit;
  while (summary.iterations < options.max_iterations) {
    if (!linearised) w.linearise(graph, options);
    linearised = true;
    ++summary.iterations;
    const bool own_factor = !keep_factor;
    double new_cost = std::numeric_limits<double>::infinity();
    if (!own_factor || w.system.factorise(damping)) {
      w.step(graph);
      new_cost = pose_graph_cost(graph, options.error, options.huber);
      if (!(new_cost < cost)) std::swap(graph.poses, w.trial);
    }
    const double decrease = (cost - new_cost) / cost;
    if (!(new_cost < cost)) {
      if (!own_factor) {  // the old factor has served its time: one more try with the right one
        keep_factor = false;
      } else if (last_decrease < 1e-3 && decrease > -1e-9) {  // rounding decides here
        summary.termination = SolverSummary::Termination::kConverged;
        break;
      } else {
        damping = std::max(10 * damping, kFirstDamping);
        if (damping > kMaxDamping) {
          summary.termination = SolverSummary::Termination::kNoStepFound;
          break;
        }
      }
      continue;
    }
    ++summary.accepted_steps;
    linearised = false;
    cost = new_cost;
    if (options.on_cost) options.on_cost(summary.iterations, cost);
    if (decrease < options.relative_decrease) {
      summary.termination = SolverSummary::Termination::kConverged;
      break;
    }
    if (own_factor)
      damping = damping <= kFirstDamping ? least_damping : std::max(least_damping, 0.1 * damping);
    const bool fast = own_factor ? decrease < options.keep_factor_below : decrease < last_decrease / 3;
    keep_factor = fast && damping == least_damping;
    last_decrease = decrease;
  }
  summary.final_cost = cost;
  return summary;
}

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
