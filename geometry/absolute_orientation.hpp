#pragma once

#include <optional>
#include <span>

#include "geometry/sim3.hpp"

namespace twofold {

/// Rigid motion T_a_b minimising sum |x_a[i] - T_a_b * x_b[i]|^2; Arun et al., PAMI 1987 (thesis eq. 5.9
/// - 5.14).
///
/// With H = sum y_a y_b^T = U S V^T the rotation is R = U diag(1, 1, det(U V^T)) V^T: eq. 5.14 prints V U^T,
/// which belongs to the transposed H, and leaves out the determinant that rules out a reflection (Umeyama,
/// PAMI 1991).
///
/// @return  nullopt for fewer than three points, spans of different length, or points on one line in either
/// frame.
[[nodiscard]] std::optional<SE3> align_rigid(std::span<const Vector3> x_a, std::span<const Vector3> x_b);

/// Similarity S_a_b with x_a[i] = S_a_b * x_b[i] up to noise; same rotation as above.
///
/// The scale is the ratio of the root mean square spreads (eq. 5.14): it treats both point sets alike, so
/// that aligning b with a gives exactly the inverse of aligning a with b, unlike the least-squares scale of
/// one direction.
[[nodiscard]] std::optional<Sim3> align_similarity(std::span<const Vector3> x_a,
                                                   std::span<const Vector3> x_b);

}  // namespace twofold
