#pragma once

#include <optional>
#include <span>
#include <vector>

#include "geometry/ransac.hpp"
#include "geometry/se3.hpp"

namespace twofold {

/// E_b_a = [t]x R of the motion T_b_a: bearing_b^T E_b_a bearing_a = 0, with |t| = 1.
[[nodiscard]] Matrix3 essential_matrix(const SE3& T_b_a);

/// All essential matrices through five pairs of bearings (any length but zero), at most ten, each with norm
/// sqrt(2).
///
/// Five-point problem (Nister, PAMI 2004) solved with the action matrix of Stewenius et al. (ISPRS 2006).
/// Appends to `solutions`; appends none for degenerate input.
void solve_five_point(std::span<const Vector3, 5> bearings_a, std::span<const Vector3, 5> bearings_b,
                      std::vector<Matrix3>& solutions);

/// Squared Sampson distance of a pair of bearings (with z != 0) from E, on the planes z = 1; first-order
/// squared distance to the nearest pair that fulfils the epipolar constraint.
[[nodiscard]] double squared_sampson_distance(const Matrix3& E_b_a, const Vector3& bearing_a,
                                              const Vector3& bearing_b);

/// The motion T_b_a with |t| = 1 among the four that E_b_a stands for, with most of the chosen pairs in front
/// of both cameras.
///
/// @param indices  the pairs that vote
/// @return  nullopt when no pair lies in front of both cameras
[[nodiscard]] std::optional<SE3> decompose_essential(const Matrix3& E_b_a,
                                                     std::span<const Vector3> bearings_a,
                                                     std::span<const Vector3> bearings_b,
                                                     std::span<const int> indices);

struct RelativePose {
  SE3 T_b_a;                 ///< translation has unit length: two views do not show the scale
  std::vector<int> inliers;  ///< pairs within the threshold, ascending
};

/// Relative pose of two calibrated views by RANSAC over the five-point solver, with the winner re-fitted to
/// its inliers (Gauss-Newton on the Sampson distance).
///
/// @param options.threshold  largest Sampson distance of an inlier on the plane z = 1, about pixels / focal
/// length
/// @return  nullopt for fewer than five pairs or when no motion is found
[[nodiscard]] std::optional<RelativePose> estimate_relative_pose(std::span<const Vector3> bearings_a,
                                                                 std::span<const Vector3> bearings_b,
                                                                 const RansacOptions& options);

}  // namespace twofold
