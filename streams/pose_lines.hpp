#pragma once

#include <cstdint>
#include <string>

#include "twofold/estimate.hpp"

namespace twofold {

enum class PoseForm : std::uint8_t {
  kJson,  ///< an object a line (docs/integrate.md has the members)
  kTum    ///< "time[s] tx ty tz qx qy qz qw" of tracked frames; what is no pose is a comment
};

// Each gives whole lines, each with its end, or nothing when the form has no line for it.
[[nodiscard]] std::string pose_line(const PoseEstimate& pose, PoseForm form);
[[nodiscard]] std::string event_line(const MapEvent& event, PoseForm form);
/// What a reader is told who could not keep up.
[[nodiscard]] std::string missed_line(std::uint64_t lines, PoseForm form);

/// What a reader is told who is not served.
[[nodiscard]] std::string error_line(const std::string& why, PoseForm form);

}  // namespace twofold
