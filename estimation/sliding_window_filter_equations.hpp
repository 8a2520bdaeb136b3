#pragma once

#include <Eigen/Cholesky>
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
struct WindowEquations {
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

struct WindowStep {
  std::vector<Vector6> poses;
  std::vector<Vector3> landmarks;
};

struct WindowCovariances {
  std::vector<Matrix6> poses;
  std::vector<Matrix3> landmarks;
};

/// Direct solution of WindowEquations by one of two elimination orders, whichever takes fewer operations:
///  * map onto path: landmarks that no prior couples are eliminated one by one, then poses and prior
///  landmarks
///    are factorised densely, O((6m + 3 n_prior)^3 + tracks);
///  * path onto map: poses are eliminated along the chain, then the map is factorised, O(6m (3n)^2 + (3n)^3).
/// Both give the same numbers up to rounding (SWF 2.2). Keeps its buffers between calls.
class WindowFactor {
 public:
  enum class Order { kCheaper, kMapOntoPath, kPathOntoMap };

  /// False when the equations (with `damping` added to the diagonal) are not positive definite.
  [[nodiscard]] bool factorise(const WindowEquations& equations, double damping,
                               Order order = Order::kCheaper);
  /// Solves for the given right-hand side with the factor of the last successful factorise().
  void solve(const std::vector<Vector6>& g_poses, const std::vector<Vector3>& g_landmarks,
             WindowStep& step) const;
  /// Diagonal blocks of the inverse.
  [[nodiscard]] WindowCovariances covariances() const;
  [[nodiscard]] Order order() const { return order_; }

 private:
  bool factorise_map_onto_path(const WindowEquations& eq, double damping);
  bool factorise_path_onto_map(const WindowEquations& eq, double damping);
  void solve_map_onto_path(const std::vector<Vector6>& gp, const std::vector<Vector3>& gm,
                           WindowStep& step) const;
  void solve_path_onto_map(const std::vector<Vector6>& gp, const std::vector<Vector3>& gm,
                           WindowStep& step) const;
  [[nodiscard]] WindowCovariances covariances_map_onto_path() const;
  [[nodiscard]] WindowCovariances covariances_path_onto_map() const;
  void group_by_landmark(const WindowEquations& eq);

  struct FreeCoupling {
    int pose;
    Matrix63 W;
    Matrix63 WV;  ///< W V^-1
  };

  Order order_ = Order::kCheaper;
  int m_ = 0, n_ = 0, n_prior_ = 0;
  MatrixX S_;  ///< reduced system, replaced by its Cholesky factor (lower)
  // Map onto path.
  std::vector<int> first_;  ///< per free landmark: first entry of free_couplings_
  std::vector<FreeCoupling> free_couplings_;
  std::vector<Matrix3> V_inv_;
  // Path onto map: per pose the factor L_j of its pivot and Y_j = L_j^-1 [W_j | E_j].
  std::vector<Matrix6> L_;
  std::vector<Matrix6> Y_E_;
  MatrixX Y_W_;  ///< 6m x 3n
  bool has_motion_ = false;
};

}  // namespace twofold
