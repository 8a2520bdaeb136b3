#pragma once

#include <string>
#include <string_view>

#include "evaluation/trajectory.hpp"

namespace twofold {

/// What a trajectory file in TUM form begins with.
inline constexpr std::string_view kTumHeader = "# time[s] tx ty tz qx qy qz qw  (T_w_c)\n";

/// A pose as a line of such a file: nine decimals, qw >= 0.
[[nodiscard]] std::string tum_line(const TimedPose& pose);

}  // namespace twofold
