#pragma once

#include <span>

namespace twofold {

/// Real roots of c[0] + c[1] z + ... + c[n] z^n, n <= 16, in no order.
///
/// Between two neighbouring roots of its derivative a polynomial is monotonic and has one root at most: its
/// derivatives are solved from the linear one upwards, by Newton's steps that a bracket holds. Roots within
/// [-1, 1] are those of the polynomial, all others the reciprocals of those of the reversed one, so that no
/// power grows large. Of a root of even multiplicity, where the sign does not change, nothing is found, or
/// two roots beside it.
/// @param roots  out: at least n
/// @return how many; 0 for a constant and for coefficients that are not finite
int real_roots(std::span<const double> coefficients, std::span<double> roots);

}  // namespace twofold
