#pragma once

#include <optional>

#include "geometry/types.hpp"

namespace twofold {

/// M = U diag(singular_values) V^T with orthogonal U and V, the largest singular value first.
struct SingularValueDecomposition {
  Matrix3 U, V;
  Vector3 singular_values;
};

/// Compiled once for all who need it, which Eigen's templates are not; nothing when M is not finite.
[[nodiscard]] std::optional<SingularValueDecomposition> decompose(const Matrix3& M);

}  // namespace twofold
