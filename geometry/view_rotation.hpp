#pragma once

#include <optional>
#include <span>
#include <vector>

#include "geometry/ransac.hpp"
#include "geometry/so3.hpp"

namespace twofold {

struct ViewRotation {
  SO3 R_b_a;
  std::vector<int> inliers;  ///< pairs that it brings together within the threshold, ascending
};

/// Squared distance, on the plane z = 1 of view b, between bearing_b and bearing_a turned into b; infinite
/// when that is not in front of b. Bearings have z > 0.
[[nodiscard]] double squared_rotation_residual(const SO3& R_b_a, const Vector3& bearing_a,
                                               const Vector3& bearing_b);

/// The rotation that explains most pairs of bearings of two views: all of them when the camera turned on the
/// spot, those far away when it moved. RANSAC over two pairs.
///
/// @param options.threshold  on the plane z = 1, about pixels / focal length
/// @return  nullopt for fewer than two pairs
[[nodiscard]] std::optional<ViewRotation> estimate_view_rotation(std::span<const Vector3> bearings_a,
                                                                 std::span<const Vector3> bearings_b,
                                                                 const RansacOptions& options);
/// The same without the fit to all of its pairs.
struct RoughViewRotation {
  SO3 R_b_a;
  int inliers = 0;
};
/// @param models  scratch: nothing is allocated where it has room for one
[[nodiscard]] std::optional<RoughViewRotation> rough_view_rotation(std::span<const Vector3> bearings_a,
                                                                   std::span<const Vector3> bearings_b,
                                                                   const RansacOptions& options,
                                                                   std::vector<SO3>& models);

}  // namespace twofold
