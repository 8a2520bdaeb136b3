#pragma once

#include <optional>
#include <vector>

#include "estimation/point_elimination.hpp"
#include "estimation/window_layout.hpp"
#include "estimation/window_problem.hpp"
#include "estimation/window_state.hpp"
#include "sparse/block_cholesky.hpp"

namespace twofold {

/// Normal equations of a window with the points eliminated: J^T W J + lambda D over the poses, in the
/// elimination order of the layout. D is the diagonal of J^T W J.
class ReducedSystem {
 public:
  /// Sorts the problem; returns its values.
  [[nodiscard]] WindowState start(const WindowProblem& problem);

  void build(const WindowProblem& problem, const WindowSolverOptions& options, const WindowState& state,
             double lambda);
  /// False when the system built last is not positive definite. Needed before advance and factor.
  [[nodiscard]] bool factorise() { return cholesky_.factorise(); }
  /// Step of all unknowns from `state`, where the system was built, to `next`; returns the decrease of the
  /// cost the quadratic model promises, nullopt when it is not a number.
  [[nodiscard]] std::optional<double> advance(const WindowProblem& problem, const WindowState& state,
                                              double lambda, WindowState& next);

  [[nodiscard]] const WindowLayout& layout() const { return layout_; }
  [[nodiscard]] const BlockCholesky& factor() const { return cholesky_; }

 private:
  void add_constraint(const WindowProblem::PoseConstraint& constraint,
                      const WindowLayout::ConstraintPlace& place, const HuberKernel& kernel,
                      const RigidMotion& T_j_i, const Vector6& v);

  WindowLayout layout_;
  BlockCholesky cholesky_;
  PointElimination elimination_;
  std::vector<Vector6> gradient_, diagonal_, pose_steps_;  // by position
  std::vector<Vector3> psi_steps_;                         // by track
};

}  // namespace twofold
