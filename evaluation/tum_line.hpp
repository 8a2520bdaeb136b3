#pragma once

#include <cstdint>
#include <string>
#include <string_view>

#include "evaluation/trajectory.hpp"

namespace twofold {

/// What a trajectory file in TUM form begins with.
inline constexpr std::string_view kTumHeader = "# time[s] tx ty tz qx qy qz qw  (T_w_c)\n";

/// Nanoseconds as seconds with nine decimals, "-0.966666667".
[[nodiscard]] std::string seconds_text(std::int64_t t_ns);

/// A pose as a line of such a file: nine decimals, qw >= 0.
[[nodiscard]] std::string tum_line(const TimedPose& pose);

}  // namespace twofold
