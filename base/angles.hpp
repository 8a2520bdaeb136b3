#pragma once

#include <numbers>

namespace twofold {

inline constexpr double kDegree = std::numbers::pi / 180;  ///< [rad]

}  // namespace twofold
