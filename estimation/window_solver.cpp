#include "estimation/window_solver.hpp"

#include <cmath>
#include <optional>

#include "estimation/block_cholesky.hpp"
#include "estimation/levenberg_marquardt.hpp"
#include "estimation/point_elimination.hpp"
#include "estimation/pose_constraint.hpp"
#include "estimation/window_layout.hpp"
#include "geometry/check.hpp"

namespace twofold {
namespace {

/// Values of all unknowns, and what follows from them.
struct WindowState {
  std::vector<SE3> poses;
  std::vector<Vector3> psi;            // by track
  std::vector<RelativePose> relative;  // by slot
};

}  // namespace

struct WindowSolver::Workspace {
  WindowLayout layout;
  BlockCholesky system;
  PointElimination elimination;
  WindowState state, candidate;
  std::vector<Vector6> gradient, diagonal, pose_steps;
  std::vector<Vector3> psi_steps;

  void start(const WindowProblem& problem);
  [[nodiscard]] double cost(const WindowProblem& problem, const WindowSolverOptions& options,
                            const std::vector<Vector3>& psi_before, WindowState& values) const;
  void build_system(const WindowProblem& problem, const WindowSolverOptions& options, double lambda);
  void add_constraint(const WindowProblem::PoseConstraint& constraint, const HuberKernel& kernel);
  /// Step of Levenberg-Marquardt from state to candidate; returns the decrease the quadratic model promises,
  /// nullopt when the system cannot be solved.
  [[nodiscard]] std::optional<double> step(double lambda);
  void write_back(WindowProblem& problem) const;
};

void WindowSolver::Workspace::start(const WindowProblem& problem) {
  layout.build(problem, system);
  state.poses.clear();
  for (const auto& pose : problem.poses) state.poses.push_back(pose.T_k_w);
  state.psi.clear();
  for (const auto& track : layout.tracks()) state.psi.push_back(problem.points[track.point].psi);
  relative_poses(layout, state.poses, state.relative);
  candidate = state;
}

double WindowSolver::Workspace::cost(const WindowProblem& problem, const WindowSolverOptions& options,
                                     const std::vector<Vector3>& psi_before, WindowState& values) const {
  double sum = points_cost(layout, ObservationModel(problem.rig), HuberKernel{options.huber_px},
                           values.relative, psi_before, values.psi);
  const HuberKernel kernel{options.constraint_huber};
  for (const auto& c : problem.constraints) {
    const Vector6 v = pose_constraint_error(c.T_j_i, values.poses[c.i], values.poses[c.j]);
    sum += kernel.rho(v.dot(c.information * v));
  }
  return sum;
}

void WindowSolver::Workspace::add_constraint(const WindowProblem::PoseConstraint& c,
                                             const HuberKernel& kernel) {
  const int i = layout.position(c.i), j = layout.position(c.j);
  if (i < 0 && j < 0) return;
  const auto terms = linearise_pose_constraint(c.T_j_i, state.poses[c.i], state.poses[c.j]);
  const double weight = kernel.weight(terms.v.dot(c.information * terms.v));
  const Matrix6 WJ_i = weight * c.information * terms.J_i;
  const Matrix6 WJ_j = weight * c.information * terms.J_j;
  const auto add_diagonal = [&](int position, const Matrix6& J, const Matrix6& WJ) {
    if (position < 0) return;
    const Matrix6 H = J.transpose() * WJ;
    system.block(system.diagonal_index(position)) += H;
    diagonal[position] += H.diagonal();
    gradient[position] += WJ.transpose() * terms.v;
  };
  add_diagonal(i, terms.J_i, WJ_i);
  add_diagonal(j, terms.J_j, WJ_j);
  if (i < 0 || j < 0) return;
  if (i > j) {
    system.block(system.block_index(i, j)) += terms.J_i.transpose() * WJ_j;
  } else {
    system.block(system.block_index(j, i)) += terms.J_j.transpose() * WJ_i;
  }
}

/// Reduced, damped normal equations at `state`.
void WindowSolver::Workspace::build_system(const WindowProblem& problem, const WindowSolverOptions& options,
                                           double lambda) {
  system.set_zero();
  gradient.assign(system.size(), Vector6::Zero());
  diagonal.assign(system.size(), Vector6::Zero());
  elimination.eliminate(layout, ObservationModel(problem.rig), HuberKernel{options.huber_px}, state.relative,
                        state.psi, lambda, system, gradient, diagonal);
  for (const auto& c : problem.constraints) add_constraint(c, HuberKernel{options.constraint_huber});

  // A direction in which nothing pulls at a pose is held by a share of what pulls at the average pose.
  Vector6 mean = Vector6::Zero();
  for (const Vector6& d : diagonal) mean += d / static_cast<double>(diagonal.size());
  for (int p = 0; p < system.size(); ++p) {
    diagonal[p] = diagonal[p].cwiseMax(1e-6 * mean);
    system.block(system.diagonal_index(p)).diagonal() += lambda * diagonal[p];
  }
}

std::optional<double> WindowSolver::Workspace::step(double lambda) {
  if (!system.factorise()) return std::nullopt;
  pose_steps.resize(gradient.size());
  for (std::size_t p = 0; p < gradient.size(); ++p) pose_steps[p] = -gradient[p];
  system.solve(pose_steps);
  // With damping D: promised decrease = -g^T delta + lambda delta^T D delta; elimination splits the first
  // term into one of the reduced system and |c|^2 of every point.
  double predicted = 0;
  for (std::size_t p = 0; p < gradient.size(); ++p) {
    const Vector6& delta = pose_steps[p];
    predicted += -gradient[p].dot(delta) + lambda * delta.dot(diagonal[p].cwiseProduct(delta));
  }
  elimination.back_substitute(layout, state.relative, pose_steps, lambda, psi_steps, predicted);
  if (!std::isfinite(predicted)) return std::nullopt;

  for (std::size_t i = 0; i < state.poses.size(); ++i) {
    const int p = layout.position(static_cast<int>(i));
    if (p >= 0) candidate.poses[i] = SE3::exp(pose_steps[p]) * state.poses[i];
  }
  for (std::size_t k = 0; k < state.psi.size(); ++k) {
    candidate.psi[k] = state.psi[k] + psi_steps[k];
    candidate.psi[k].z() = std::max(candidate.psi[k].z(), kMinInverseDepth);
  }
  relative_poses(layout, candidate.poses, candidate.relative);
  return predicted;
}

void WindowSolver::Workspace::write_back(WindowProblem& problem) const {
  for (std::size_t i = 0; i < problem.poses.size(); ++i) {
    if (layout.position(static_cast<int>(i)) >= 0) problem.poses[i].T_k_w = state.poses[i];
  }
  for (std::size_t k = 0; k < state.psi.size(); ++k) {
    problem.points[layout.tracks()[k].point].psi = state.psi[k];
  }
}

WindowSolver::WindowSolver() : workspace_(std::make_unique<Workspace>()) {}
WindowSolver::~WindowSolver() = default;
WindowSolver::WindowSolver(WindowSolver&&) noexcept = default;
WindowSolver& WindowSolver::operator=(WindowSolver&&) noexcept = default;

SolverSummary WindowSolver::solve(WindowProblem& problem, const WindowSolverOptions& options) {
  using Termination = SolverSummary::Termination;
  TWOFOLD_CHECK(invalid_reason(problem).empty(), "window problem");
  Workspace& w = *workspace_;
  w.start(problem);
  SolverSummary summary;
  if (w.system.size() == 0 && w.layout.tracks().empty()) return summary;
  double cost = w.cost(problem, options, w.state.psi, w.state);
  summary.initial_cost = cost;
  summary.termination = Termination::kIterationLimit;
  LevenbergMarquardtDamping damping(options.initial_damping);
  while (summary.iterations < options.max_iterations && !damping.exhausted()) {
    ++summary.iterations;
    w.build_system(problem, options, damping.lambda());
    const auto predicted = w.step(damping.lambda());
    if (!predicted) {
      damping.reject();
      continue;
    }
    const double new_cost = w.cost(problem, options, w.state.psi, w.candidate);
    if (*predicted <= 1e-15 * cost) {  // rounding decides whether such a step goes up or down
      summary.termination = Termination::kConverged;
      break;
    }
    if (!(new_cost < cost)) {
      damping.reject();
      continue;
    }
    const double decrease = cost - new_cost;
    std::swap(w.state, w.candidate);
    cost = new_cost;
    ++summary.accepted_steps;
    damping.accept(decrease / *predicted);
    if (decrease < options.relative_decrease * cost) {
      summary.termination = Termination::kConverged;
      break;
    }
  }
  if (summary.accepted_steps == 0 && summary.termination != Termination::kConverged) {
    summary.termination = Termination::kNoStepFound;
  }
  summary.final_cost = cost;
  w.write_back(problem);
  return summary;
}

}  // namespace twofold
