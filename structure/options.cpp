#include "structure/options.hpp"

#include <string>

namespace twofold {

std::string StructureOptions::invalid_reason() const {
  if (std::string reason = filter.invalid_reason(); !reason.empty()) return reason;
  if (features < 8) return "features must be >= 8, is " + std::to_string(features);
  if (!(sigma_px > 0)) return "sigma_px must be > 0, is " + std::to_string(sigma_px);
  if (refinements < 0) return "refinements must be >= 0, is " + std::to_string(refinements);
  if (cell_px < 1) return "cell_px must be > 0, is " + std::to_string(cell_px);
  if (corner_cell_px < 4 || corner_cell_px % 4 != 0) {
    return "corner_cell_px must be a positive multiple of 4, is " + std::to_string(corner_cell_px);
  }
  if (!(search_share > 0)) return "search_share must be > 0, is " + std::to_string(search_share);
  if (!(max_sad_ratio > 0) || max_sad_ratio >= 1) {
    return "max_sad_ratio must be in (0, 1), is " + std::to_string(max_sad_ratio);
  }
  if (min_matches < 3) return "min_matches must be >= 3, is " + std::to_string(min_matches);
  return {};
}

}  // namespace twofold
