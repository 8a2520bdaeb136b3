#pragma once

#include <filesystem>

#include "doctor/finding.hpp"

namespace twofold {

/// Writes and syncs `bytes` of a scratch file in the folder and takes the time, then removes it.
///
/// @param needed_bytes_per_second  of the recording, as grey images before PNG makes them smaller
[[nodiscard]] Finding check_disk(const std::filesystem::path& folder, double needed_bytes_per_second,
                                 std::size_t bytes = std::size_t{64} << 20U);

}  // namespace twofold
