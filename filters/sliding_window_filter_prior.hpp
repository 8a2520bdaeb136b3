#pragma once

#include <vector>

#include "filters/sliding_window_filter_equations.hpp"
#include "geometry/se3.hpp"

namespace twofold {

/// Prior information of the filter, x_Pi ~ N(x, Pi^-1) in canonical form  (SWF eq. 1): the quadratic
///   d^T Pi d / 2 - eta^T d,   d = state (-) linearisation point,
/// over the first landmarks of the state and the oldest pose, order [landmarks | pose], where
/// d = l - l_lin for a landmark and log(T T_lin^-1) for the pose.
struct FilterPrior {
  MatrixX information = MatrixX::Zero(6, 6);  ///< Pi, symmetric, size 3 n + 6
  VectorX vector = VectorX::Zero(6);          ///< eta
  std::vector<Vector3> landmarks_lin;         ///< linearisation points [m]
  SE3 T_lin;
  /// 6 x (3 n + 6): twist of the rigid motion nearest to a step of the prior's parameters, in the camera
  /// frame of T_lin, where it is well conditioned however far away the origin is. Empty: none is taken out.
  MatrixX follow;

  [[nodiscard]] int landmark_count() const { return static_cast<int>(landmarks_lin.size()); }
  /// d at the given state; landmarks has at least landmark_count() entries. `shift`: twist, in the
  /// camera frame of T_lin, by which the frame of both has moved since the prior was made; enters to first
  /// order, so that a rigid motion of everything is linear in it.
  [[nodiscard]] VectorX difference(const std::vector<Vector3>& landmarks, const SE3& T_c_w,
                                   const Vector6& shift = Vector6::Zero()) const;
  /// Moves the linearisation point to the given state; the quadratic keeps value and slope there.
  void relinearise(const std::vector<Vector3>& landmarks, const SE3& T_c_w);

  /// Sets `follow`: least squares over landmarks and pose, each weighted with its own block of Pi.
  void fit_frame();
  /// Twist of the frame, in the camera frame of T_lin, that takes what all have in common out of a step.
  [[nodiscard]] Vector6 frame_twist(const FilterStep& step) const;
  /// From here on difference() counts from the frame moved by shift. Returns that motion in the frame itself.
  SE3 move_frame(const Vector6& shift);

 private:
  /// d by the twist of a motion of everything, (3 n + 6) x 6.
  [[nodiscard]] MatrixX rigid_motion() const;
};

/// What is done with the fill-in Lambda_b^T Lambda_a^-1 Lambda_b of an elimination.
enum class FillIn {
  kFull,          ///< Schur complement: exact marginalisation  (SWF eq. 9, 10)
  kBlockDiagonal  ///< only its blocks on the diagonal: the sparse VSDF  (SWF eq. 12)
};

/// Eliminates the first `eliminated` unknowns of Lambda x = g:
///   Lambda_c - Lambda_b^T Lambda_a^-1 Lambda_b,  g_b - Lambda_b^T Lambda_a^-1 g_a   (SWF eq. 9).
///
/// @param block_sizes  sizes of the diagonal blocks of the remaining unknowns, used by kBlockDiagonal; sizes
///        of one are eq. 12 as printed. Lambda_c minus bare diagonal entries need not be positive
///        semi-definite; minus whole blocks it is, when Lambda_c has no information between the blocks.
/// Directions of Lambda_a without information are left out (pseudo-inverse), not an error.
void schur_marginalise(MatrixX& Lambda, VectorX& g, int eliminated, FillIn fill_in,
                       const std::vector<int>& block_sizes = {});

}  // namespace twofold
