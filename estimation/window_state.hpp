#pragma once

#include <vector>

#include "estimation/window_layout.hpp"
#include "estimation/window_problem.hpp"

namespace twofold {

/// A pose as the inner loops want it: x = R y + t.
struct RigidMotion {
  Matrix3 R;
  Vector3 t;
};

/// T_i_j = T_i T_j^-1
[[nodiscard]] inline RigidMotion relative_motion(const RigidMotion& T_i, const RigidMotion& T_j) {
  RigidMotion T_i_j;
  T_i_j.R.noalias() = T_i.R * T_j.R.transpose();
  T_i_j.t = T_i.t - T_i_j.R * T_j.t;
  return T_i_j;
}

/// Ad(T)^T
[[nodiscard]] inline Matrix6 adjoint_transposed(const RigidMotion& T) {
  Matrix6 result;
  result.topLeftCorner<3, 3>() = T.R.transpose();
  result.topRightCorner<3, 3>().setZero();
  for (int r = 0; r < 3; ++r) result.bottomLeftCorner<3, 3>().row(r) = T.t.cross(T.R.col(r));
  result.bottomRightCorner<3, 3>() = T.R.transpose();
  return result;
}

/// Values of all unknowns of a window, and what follows from them.
struct WindowState {
  std::vector<SE3> poses;
  std::vector<Vector3> psi;  ///< by track
  // Follow from the poses:
  std::vector<RigidMotion> matrices;       ///< T_i, by pose
  std::vector<RigidMotion> relative;       ///< T_i T_a^-1, by slot
  std::vector<Vector6> constraint_errors;  ///< v_ji

  /// Brings what follows from the poses up to date.
  void relate(const WindowProblem& problem, const WindowLayout& layout);
};

/// Robustified cost of eq. 6.4 at `values`; infinity when a used observation lies behind its camera. Points
/// for which only their own step is to blame for that are put back to `psi_before`.
[[nodiscard]] double window_state_cost(const WindowProblem& problem, const WindowLayout& layout,
                                       const WindowSolverOptions& options,
                                       const std::vector<Vector3>& psi_before, WindowState& values);

}  // namespace twofold
