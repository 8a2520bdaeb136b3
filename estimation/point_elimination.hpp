#pragma once

#include <span>
#include <vector>

#include "estimation/block_cholesky.hpp"
#include "estimation/observation_model.hpp"
#include "estimation/window_layout.hpp"

namespace twofold {

/// Pose of an observer against the anchor, as the inner loops want it: x = R y + t.
struct RelativePose {
  Matrix3 R;
  Vector3 t;
};

/// Normal equations of the points, eliminated track by track (Schur complement, thesis 3.3.5).
///
/// For a point with Jacobians A_i by xi_i (see WindowLayout) and B by psi, and V = B^T W B + lambda D = L
/// L^T, Y_i = A_i^T W B L^-T and c = L^-1 B^T W e, elimination subtracts Y_i Y_j^T from the slots' Hessian
/// and Y_i c from their gradient; the point's own step is -L^-T (c + sum Y_i^T xi_i).
class PointElimination {
 public:
  using Matrix63 = Eigen::Matrix<double, 6, 3>;
  /// What back substitution needs of a track; its Y_i stand in couplings().
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
                 const std::vector<RelativePose>& relative, const std::vector<Vector3>& psi, double lambda,
                 BlockCholesky& system, std::span<Vector6> gradient, std::span<Vector6> diagonal);

  /// Steps of the points for given steps of the poses (by position); what the quadratic model promises from
  /// the elimination and the damping of the points is added to `predicted`.
  void back_substitute(const WindowLayout& layout, const std::vector<RelativePose>& relative,
                       std::span<const Vector6> pose_steps, double lambda, std::vector<Vector3>& psi_steps,
                       double& predicted);

  /// By track.
  [[nodiscard]] const std::vector<EliminatedPoint>& points() const { return points_; }
  /// Y_i, by entry of the layout.
  [[nodiscard]] const std::vector<Matrix63>& couplings() const { return couplings_; }

 private:
  void eliminate_track(const WindowLayout::Track& track, const WindowLayout::Observation* observations,
                       const int* entry_slots, const ObservationModel& model, const HuberKernel& kernel,
                       const RelativePose* relative, const Vector3& psi, double lambda,
                       EliminatedPoint& point);
  void add_to_slot(int slot, const ObservationTerms& terms, const Vector3& x);
  void add_group(const WindowLayout& layout, const WindowLayout::Group& group, const RelativePose* relative,
                 BlockCholesky& system, std::span<Vector6> gradient, std::span<Vector6> diagonal);

  std::vector<EliminatedPoint> points_;
  std::vector<Matrix63> couplings_;
  // Of the group at hand, in slot coordinates:
  std::vector<Matrix6> hessian_;      // lower triangle, row by row, of - sum Y_i Y_j^T
  std::vector<Matrix6> information_;  // sum A_i^T W A_i of each slot
  std::vector<Vector6> slot_gradient_;
  std::vector<Matrix6> adjoint_transposed_;
  std::vector<Matrix6> times_adjoint_;
  std::vector<Vector6> xi_;
};

/// T_i T_a^-1 of every slot.
void relative_poses(const WindowLayout& layout, const std::vector<SE3>& poses,
                    std::vector<RelativePose>& relative);

/// Robustified cost of all points; infinity when one of them comes to lie behind a camera. A point for which
/// only its own step is to blame is put back to where it was.
[[nodiscard]] double points_cost(const WindowLayout& layout, const ObservationModel& model,
                                 const HuberKernel& kernel, const std::vector<RelativePose>& relative,
                                 const std::vector<Vector3>& psi_before, std::vector<Vector3>& psi);

}  // namespace twofold
