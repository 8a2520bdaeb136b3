#pragma once

#include <cstdint>

namespace twofold {

/// Where the filters take derivatives of variables that carry prior information.
///
/// Information once marginalised is tied to the point it was linearised at. If later measurements of the same
/// variables are linearised elsewhere, the sum claims to know directions that no measurement sees (position
/// and heading of the whole), and the filter grows over-confident. kFirstEstimate takes all derivatives of
/// such a variable at the estimate it had when it entered the prior, residuals always at the current one.
enum class Linearisation : std::uint8_t {
  kCurrent,       ///< always at the current estimate: the textbook's iterated filter
  kFirstEstimate  ///< fixed once a variable is in the prior
};

}  // namespace twofold
