#pragma once

#include <cstdint>
#include <string>

#include "camera/frame.hpp"
#include "camera/rig.hpp"

namespace twofold {

/// What tells one run's input from another's: its rig, and the first frame. A schedule repeats a run over the
/// same input only; over any other one it may well be followed to its end, and mean nothing.
struct InputFingerprint {
  std::uint64_t rig = 0;          ///< of all numbers that tracking depends on
  std::uint64_t first_frame = 0;  ///< of time stamp and pixels
  bool operator==(const InputFingerprint&) const = default;
};

/// O(pixels): some 0.5 ms for a pair of 640 x 480.
[[nodiscard]] InputFingerprint fingerprint_of(const Rig& rig, const Frame& first);

/// Why a schedule of the input `expected` cannot be repeated over `given`: a clause about "the schedule".
/// Empty: it can.
[[nodiscard]] std::string mismatch(const InputFingerprint& expected, const InputFingerprint& given);

}  // namespace twofold
