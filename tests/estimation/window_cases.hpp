#pragma once

#include <algorithm>

#include "estimation/window_solver.hpp"
#include "fixtures/synthetic_window.hpp"

namespace twofold {

inline SyntheticWindowOptions small_window() {
  SyntheticWindowOptions options;
  options.start_pose_noise = 0.02;
  options.start_depth_noise = 0.05;
  return options;
}

inline WindowSolverOptions to_convergence() {
  WindowSolverOptions options;
  options.max_iterations = 100;
  options.relative_decrease = 1e-13;
  return options;
}

/// Largest difference of relative poses against pose 0: gauge-free.
inline double relative_pose_error(const WindowProblem& a, const WindowProblem& b) {
  double largest = 0;
  for (std::size_t i = 1; i < a.poses.size(); ++i) {
    const SE3 rel_a = a.poses[i].T_k_w * a.poses[0].T_k_w.inverse();
    const SE3 rel_b = b.poses[i].T_k_w * b.poses[0].T_k_w.inverse();
    largest = std::max(largest, (rel_a * rel_b.inverse()).log().norm());
  }
  return largest;
}

}  // namespace twofold
