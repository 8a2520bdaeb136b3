#pragma once

#include <random>

#include "geometry/se3.hpp"

namespace twofold {

/// exp of six independent standard normal numbers.
inline SE3 random_pose(std::mt19937& rng) {
  std::normal_distribution<double> normal;
  Vector6 v;
  for (int i = 0; i < 6; ++i) v[i] = normal(rng);
  return SE3::exp(v);
}

}  // namespace twofold
