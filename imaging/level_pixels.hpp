#pragma once

#include <cmath>

#include "geometry/types.hpp"

namespace twofold {

// Between pixels of level 0 and of a pyramid level (ImagePyramid has the convention).

[[nodiscard]] inline Eigen::Vector2f to_level(const Vector2& uv, int level) {
  const double s = std::ldexp(1.0, -level);
  return ((uv.array() + 0.5) * s - 0.5).matrix().cast<float>();
}

/// In single precision throughout, for places that were measured in it.
[[nodiscard]] inline Eigen::Vector2f to_level(float u, float v, int level) {
  const float s = std::ldexp(1.0F, -level);
  return {(u + 0.5F) * s - 0.5F, (v + 0.5F) * s - 0.5F};
}

[[nodiscard]] inline double to_level(double p, int level) {
  return (p + 0.5) * std::ldexp(1.0, -level) - 0.5;
}

[[nodiscard]] inline double from_level(double p, int level) {
  return (p + 0.5) * std::ldexp(1.0, level) - 0.5;
}

[[nodiscard]] inline Vector2 from_level(const Eigen::Vector2f& p, int level) {
  return {from_level(p.x(), level), from_level(p.y(), level)};
}

}  // namespace twofold
