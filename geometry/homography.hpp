#pragma once

#include <optional>
#include <span>
#include <vector>

#include "geometry/ransac.hpp"
#include "geometry/se3.hpp"

namespace twofold {

struct Homography {
  Matrix3 H_b_a;             ///< bearing_b ~ H_b_a bearing_a, for points of one plane
  std::vector<int> inliers;  ///< pairs within the threshold, ascending
};

/// Homography between two calibrated views of a plane: RANSAC over four pairs (direct linear transformation),
/// fitted again to its inliers. Bearings have z > 0.
///
/// @param options.threshold  largest distance in view b, on the plane z = 1, about pixels / focal length
/// @return  nullopt for fewer than four pairs, or when no homography is found
[[nodiscard]] std::optional<Homography> estimate_homography(std::span<const Vector3> bearings_a,
                                                            std::span<const Vector3> bearings_b,
                                                            const RansacOptions& options);

/// Motions that H_b_a ~ R + t n^T / d stands for, with |t| = 1: four in general, as pairs of opposite t and
/// n; none for a rotation on the spot. Ma, Soatto, Kosecka, Sastry, An Invitation to 3-D Vision, 5.3.
///
/// @param bearing_a, bearing_b  any pair that the homography brings together: it says its sign
[[nodiscard]] std::vector<SE3> decompose_homography(const Matrix3& H_b_a, const Vector3& bearing_a,
                                                    const Vector3& bearing_b);

}  // namespace twofold
