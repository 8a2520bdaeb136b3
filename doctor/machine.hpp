#pragma once

#include <filesystem>

#include "doctor/finding.hpp"

namespace twofold {

/// What of the machine hurts real time: cores, processor features, frequency governor, clock source, timer
/// slack, load, limits on SCHED_FIFO and locked memory.
///
/// @param root  where proc/ and sys/ are: "/", or a tree of a test. What is not there (containers) is left
///              out or said to be unknown; nothing throws.
[[nodiscard]] std::vector<Finding> check_machine(const std::filesystem::path& root);

}  // namespace twofold
