#pragma once

#include <span>

namespace twofold {

/// Whether c[0] + c[1] z + ... + c[n] z^n, n <= 8, is positive on all of [0, end].
///
/// Bernstein coefficients bound a polynomial from below, and the first and last of them are its values at the
/// ends; where they do not decide, the interval is halved (Lane and Riesenfeld, BIT 1981). One that comes so
/// near to zero that thirty halvings do not decide is not positive; nor is one that is not finite.
/// @param end  >= 0
[[nodiscard]] bool is_positive_to(double end, std::span<const double> coefficients);

}  // namespace twofold
