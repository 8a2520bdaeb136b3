#pragma once

#include <optional>

#include "geometry/so3.hpp"

namespace twofold {

/// M = U diag(singular_values) V^T with orthogonal U and V, the largest singular value first.
struct SingularValueDecomposition {
  Matrix3 U, V;
  Vector3 singular_values;
};

/// Compiled once for all who need it, which Eigen's templates are not; nothing when M is not finite.
[[nodiscard]] std::optional<SingularValueDecomposition> decompose(const Matrix3& M);

/// The rotation R nearest to M in the Frobenius norm, that is, the one with the largest tr(R^T M); Umeyama,
/// PAMI 1991.
///
/// With M = U S V^T it is R = U diag(1, .., 1, det(U V^T)) V^T: the determinant rules out a reflection. M may
/// have any rank; where several rotations are as near (rank below two), it is one of them. NaN makes a
/// rotation of NaN.
/// @param singular_values  unless null: those of M, the largest first
[[nodiscard]] Matrix3 nearest_rotation(const Matrix3& M, Vector3* singular_values = nullptr);
[[nodiscard]] Eigen::Matrix2d nearest_rotation(const Eigen::Matrix2d& M);

}  // namespace twofold
