#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "evaluation/evaluation.hpp"

namespace twofold {

/// Poses of an estimate that have a partner in the truth, and how many there are in all.
struct PosePairing {
  std::vector<PosePair> pairs;
  std::size_t of = 0;
  bool has_times = true;  ///< else poses are paired by line (KITTI form)
};

/// Brings a trajectory file together with another or with a recording's truth: by time, or by line when
/// neither has times. Where hardly any poses find together by time, other units of the time stamps in files
/// of TUM's form are tried. What is taken for granted is said on stderr. Throws IoError when a file cannot be
/// read, only one of them has times, or no poses find together.
[[nodiscard]] PosePairing pair_poses(const std::string& estimate, const std::string& truth,
                                     std::int64_t max_difference_ns);

}  // namespace twofold
