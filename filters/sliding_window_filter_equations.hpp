#pragma once

#include <vector>

#include "geometry/types.hpp"

namespace twofold {

using MatrixX = Eigen::MatrixXd;
using VectorX = Eigen::VectorXd;
using Matrix63 = Eigen::Matrix<double, 6, 3>;

/// Normal equations of one window in their three-part block structure  (SWF eq. 6, 7, figure 4).
///
/// Unknowns: n landmarks (3 each) and m poses (6 each). The pose block is block tridiagonal (U, E), the
/// measurement part of the map block is block diagonal (V), the observation block is sparse (W), and the
/// prior is dense over the first `prior_landmarks` landmarks and pose 0.
struct FilterEquations {
  struct Coupling {  ///< W: block of pose and landmark, 6 x 3
    int pose = 0;
    int landmark = 0;
    Matrix63 W;
  };

  int prior_landmarks = 0;
  MatrixX prior;  ///< Pi, order [prior landmarks | pose 0], size 3 prior_landmarks + 6
  std::vector<Matrix6> U;
  std::vector<Matrix6> E;  ///< E[j] couples pose j (rows) and j + 1 (columns); size m - 1
  std::vector<Matrix3> V;
  std::vector<Coupling> couplings;  ///< those of one pose stand together, in the order of poses
  std::vector<Vector6> g_poses;     ///< right-hand side: minus the gradient
  std::vector<Vector3> g_landmarks;
  bool has_motion = false;  ///< any E non-zero

  [[nodiscard]] int pose_count() const { return static_cast<int>(U.size()); }
  [[nodiscard]] int landmark_count() const { return static_cast<int>(V.size()); }
  void reset(int poses, int landmarks);
};

struct FilterStep {
  std::vector<Vector6> poses;
  std::vector<Vector3> landmarks;
};

struct FilterCovariances {
  std::vector<Matrix6> poses;
  std::vector<Matrix3> landmarks;
};

}  // namespace twofold
