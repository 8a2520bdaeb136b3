#include "estimation/pose_graph.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>

#include "estimation/pose_graph_error.hpp"
#include "estimation/pose_graph_initialisation.hpp"
#include "estimation/robust_kernel.hpp"
#include "estimation/sparse_block_solver.hpp"
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
  BlockStructure structure;
  SparseBlockSolver system;
  Eigen::MatrixXd gradient, delta;  ///< H delta = gradient; the step is -delta
  std::vector<Group> before;

  void analyse(const PoseGraph<Group>& graph) {
    std::vector<std::pair<int, int>> now;
    now.reserve(graph.constraints.size());
    for (const auto& c : graph.constraints) now.emplace_back(c.i, c.j);
    if (poses == static_cast<int>(graph.poses.size()) && now == edges) return;
    edges = std::move(now);
    poses = static_cast<int>(graph.poses.size());
    structure = analyse_blocks(poses, edges, kDof);
    system.set_structure(structure, kDof);
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
      if (c.i != graph.origin && c.j != graph.origin) system.add_off_diagonal<kDof>(k, H_ij);
    }
    if (graph.origin >= 0) system.add_diagonal<kDof>(graph.origin, Block::Identity());  // its step is zero
  }

  /// poses <- exp(-scale delta) start.
  void move(const std::vector<Group>& start, double scale, std::vector<Group>& moved) const {
    moved.resize(start.size());
    for (int i = 0; i < poses; ++i) {
      moved[i] = Group::exp(-scale * delta.template block<kDof, 1>(kDof * i, 0)) * start[i];
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

/// Levenberg-Marquardt damping relative to the diagonal; `least` is 0 for Gauss-Newton.
class Damping {
 public:
  explicit Damping(double least) : least_(least), value_(least) {}
  [[nodiscard]] double value() const { return value_; }
  [[nodiscard]] bool least() const { return value_ == least_; }
  /// gain: true decrease over the one the linear model promised.
  void accepted(double gain) {
    if (gain < 0.25) value_ *= 4;
    if (gain > 0.75) value_ *= 0.1;
    if (value_ < kNone) value_ = least_;
  }
  /// False when there is nothing left to try.
  [[nodiscard]] bool rejected() {
    value_ = std::max(10 * value_, kFirst);
    return value_ < kMost;
  }

 private:
  static constexpr double kNone = 1e-9, kFirst = 1e-5, kMost = 1e8;
  double least_, value_;
};

}  // namespace

template <class Group>
SolverSummary PoseGraphSolver<Group>::solve(PoseGraph<Group>& graph, const PoseGraphOptions& options) {
  using Termination = SolverSummary::Termination;
  SolverSummary summary;
  if (graph.constraints.empty()) return summary;
  TWOFOLD_CHECK(options.invalid_reason().empty(), "options are valid");
  Workspace& w = *workspace_;
  w.analyse(graph);
  Positions<Group> positions(graph, options, w.structure);
  summary.initial_cost = pose_graph_cost(graph, options.error, options.huber);
  double cost = positions.chordal(graph, summary.initial_cost, options);
  if (options.on_cost) options.on_cost(0, cost);

  constexpr double kGaugeDamping = 1e-9;
  Damping damping(graph.origin < 0 ? std::max(options.initial_damping, kGaugeDamping)
                                   : options.initial_damping);
  bool keep_factor = false;
  bool linearised = false;
  double last_decrease = 1;  // relative to the cost
  summary.termination = Termination::kIterationLimit;
  while (summary.iterations < options.max_iterations) {
    if (!linearised) w.linearise(graph, options);
    linearised = true;
    ++summary.iterations;
    const bool own_factor = !keep_factor;
    keep_factor = false;
    w.before = graph.poses;
    double new_cost = std::numeric_limits<double>::infinity();
    double promised = std::numeric_limits<double>::infinity();  // decrease of the cost by the linear model
    if (!own_factor || w.system.factorise(damping.value())) {
      w.delta = w.system.solve(w.gradient);
      promised = w.gradient.cwiseProduct(w.delta).sum();
      // An old factor may overshoot where the curvature has grown: halve. A fresh one is left to the damping.
      const double shortest = own_factor ? 1.0 : 0.25;
      for (double scale = 1; scale >= shortest && !(new_cost < cost); scale *= 0.5) {
        w.move(w.before, scale, graph.poses);
        new_cost = pose_graph_cost(graph, options.error, options.huber);
      }
    }
    if (!(new_cost < cost)) {
      graph.poses = w.before;
      if (!own_factor) continue;  // once more with its own factor
      if (promised >= 0 && promised < options.relative_decrease * cost) {
        summary.termination = Termination::kConverged;
        break;
      }
      if (damping.rejected()) continue;
      summary.termination = Termination::kNoStepFound;
      break;
    }
    const double gain = (cost - new_cost) / promised;
    new_cost = positions.resolve(graph, new_cost, options);
    const double decrease = (cost - new_cost) / cost;
    ++summary.accepted_steps;
    linearised = false;
    cost = new_cost;
    if (options.on_cost) options.on_cost(summary.iterations, cost);
    if (decrease < options.relative_decrease) {
      summary.termination = Termination::kConverged;
      break;
    }
    const bool was_least = damping.least();
    if (own_factor) damping.accepted(gain);
    keep_factor =
        was_least && (own_factor ? decrease < options.keep_factor_below : decrease < last_decrease / 3);
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
