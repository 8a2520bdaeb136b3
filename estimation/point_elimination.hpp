#pragma once

#include <span>
#include <vector>

#include "estimation/observation_model.hpp"
#include "estimation/observation_sums.hpp"
#include "estimation/window_layout.hpp"
#include "estimation/window_state.hpp"
#include "sparse/block_cholesky.hpp"

namespace twofold {

/// Normal equations of the points, eliminated track by track (Schur complement, thesis 3.3.5).
///
/// For a point with Jacobians A_i by xi_i (see WindowLayout) and B by psi, and V = B^T W B + lambda D = L
/// L^T, Y_i = A_i^T W B L^-T and c = L^-1 B^T W e, elimination subtracts Y_i Y_j^T from the slots' Hessian
/// and Y_i c from their gradient; the point's own step is -L^-T (c + sum Y_i^T xi_i).
///
/// Towards the absolute poses, xi_i = delta_i - Ad_i delta_a: the slots' blocks stay as they are, and the
/// anchor is one more pose with Jacobians -A_i Ad_i = -J_x R_i [I, -[y]x], y the point in the anchor. So its
/// coupling with the point is -[I; [y]x] F with F = sum R_i^T S_i dx_i/dpsi, at the price of one more slot a
/// point.
class PointElimination {
 public:
  using Matrix63 = Eigen::Matrix<double, 6, 3>;
  /// What back substitution needs of a track; its Y_i stand in couplings_.
  struct EliminatedPoint {
    Matrix3 L;
    Vector3 c;
    Vector3 damping;
  };

  /// Adds what remains of all points after their elimination to the reduced system.
  /// @param relative   T_ia of every slot
  /// @param psi        of every track
  /// @param gradient   of the reduced system, by position
  /// @param diagonal   of the normal equations before the elimination, by position
  void eliminate(const WindowLayout& layout, const ObservationModel& model, const HuberKernel& kernel,
                 const std::vector<RigidMotion>& relative, const std::vector<Vector3>& psi, double lambda,
                 BlockCholesky& system, std::span<Vector6> gradient, std::span<Vector6> diagonal);

  /// Steps of the points for given steps of the poses (by position); what the quadratic model promises from
  /// the elimination and the damping of the points is added to `predicted`.
  void back_substitute(const WindowLayout& layout, const std::vector<RigidMotion>& relative,
                       std::span<const Vector6> pose_steps, double lambda, std::vector<Vector3>& psi_steps,
                       double& predicted);

 private:
  using Group = WindowLayout::Group;
  /// A point before its elimination, in the terms above.
  struct PointEquations {
    Matrix3 V;
    Vector3 g;
    CouplingRows anchor;
  };

  [[nodiscard]] PointEquations linearise(const WindowLayout& layout, const WindowLayout::Track& track,
                                         const ObservationModel& model, const HuberKernel& kernel,
                                         const RigidMotion* relative, const Vector3& psi);
  void fix_depth(PointEquations& equations);
  void eliminate_track(const WindowLayout& layout, const Group& group, const WindowLayout::Track& track,
                       PointEquations& equations, double lambda, BlockCholesky& system,
                       EliminatedPoint& point);
  void add_group(const WindowLayout& layout, const Group& group, const RigidMotion* relative,
                 BlockCholesky& system, std::span<Vector6> gradient, std::span<Vector6> diagonal);

  std::vector<EliminatedPoint> points_;  // by track
  std::vector<Matrix63> couplings_;      // Y_i, by entry of the layout
  // Of the group at hand, by coupled slot:
  std::vector<ObservationSums> sums_;
  std::vector<Vector6> eliminated_gradient_;  // sum Y_i c
  std::vector<Matrix6> anchor_couplings_;     // - sum Y_i Y_a^T
  Matrix6 anchor_hessian_;                    // - sum Y_a Y_a^T
  std::vector<CouplingRows> coupling_rows_;   // of the track at hand, by entry
  std::vector<Vector6> xi_;
};

}  // namespace twofold
