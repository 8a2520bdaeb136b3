#pragma once

#include <vector>

#include "filters/sliding_window_filter_equations.hpp"

namespace twofold {

/// Direct solution of FilterEquations by one of two elimination orders, whichever takes fewer operations:
///  * map onto path: landmarks that no prior couples are eliminated one by one, then the poses and the
///    landmarks of the prior are factorised densely, O((6m + 3 n_prior)^3 + tracks);
///  * path onto map: poses are eliminated along the chain, then the map is factorised, O(6m (3n)^2 + (3n)^3).
/// Both give the same numbers up to rounding (SWF 2.2). Keeps its buffers between calls.
class FilterFactor {
 public:
  enum class Order { kCheaper, kMapOntoPath, kPathOntoMap };

  /// False when the equations (with `damping` added to the diagonal) are not positive definite.
  [[nodiscard]] bool factorise(const FilterEquations& equations, double damping,
                               Order order = Order::kCheaper);
  /// Solves for the given right-hand side with the factor of the last successful factorise().
  void solve(const std::vector<Vector6>& g_poses, const std::vector<Vector3>& g_landmarks,
             FilterStep& step) const;
  /// Diagonal blocks of the inverse.
  [[nodiscard]] FilterCovariances covariances() const;
  [[nodiscard]] Order order() const { return order_; }

 private:
  bool factorise_map_onto_path(const FilterEquations& eq, double damping);
  bool factorise_path_onto_map(const FilterEquations& eq, double damping);
  void solve_map_onto_path(const std::vector<Vector6>& gp, const std::vector<Vector3>& gm,
                           FilterStep& step) const;
  void solve_path_onto_map(const std::vector<Vector6>& gp, const std::vector<Vector3>& gm,
                           FilterStep& step) const;
  [[nodiscard]] FilterCovariances covariances_map_onto_path() const;
  [[nodiscard]] FilterCovariances covariances_path_onto_map() const;
  void group_by_landmark(const FilterEquations& eq);

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
