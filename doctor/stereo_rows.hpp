#pragma once

#include <span>

#include "doctor/finding.hpp"
#include "imaging/row_offset.hpp"

namespace twofold {

/// Whether the two images of a rectified pair have their rows in common.
///
/// @param offsets  measured in some frames; empty: in none of them enough was seen
[[nodiscard]] Finding check_rows(std::span<const RowOffset> offsets);

}  // namespace twofold
