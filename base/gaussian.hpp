#pragma once

#include <cmath>
#include <numbers>
#include <random>

namespace twofold {

/// Standard normal by Box and Muller: the standard's distributions differ between libraries, and what is
/// drawn here must not.
inline double gaussian(std::mt19937& rng) {
  const double u = (rng() + 1.0) / 4294967297.0;
  const double v = rng() / 4294967296.0;
  return std::sqrt(-2.0 * std::log(u)) * std::cos(2.0 * std::numbers::pi * v);
}

}  // namespace twofold
