#include "filters/sliding_window_filter_equations.hpp"

#include <algorithm>

namespace twofold {

void FilterEquations::reset(int poses, int landmarks) {
  U.assign(static_cast<std::size_t>(poses), Matrix6::Zero());
  E.assign(static_cast<std::size_t>(std::max(0, poses - 1)), Matrix6::Zero());
  V.assign(static_cast<std::size_t>(landmarks), Matrix3::Zero());
  g_poses.assign(U.size(), Vector6::Zero());
  g_landmarks.assign(V.size(), Vector3::Zero());
  couplings.clear();
  has_motion = false;
}

}  // namespace twofold
