#pragma once

#include <string>

#include "filters/sliding_window_filter.hpp"
#include "geometry/consistent_matches.hpp"
#include "imaging/guided_search.hpp"

namespace twofold {

/// How a patch is compared with later views  (SWF 4.1.2).
enum class PatchModel : std::uint8_t {
  kSquare,  ///< as it was first seen, shifted only
  kPlane    ///< warped by the homography of a plane facing the first camera
};

struct StructureOptions {
  SlidingWindowOptions filter;
  int features = 150;     ///< landmarks measured in a frame, >= 8
  double sigma_px = 0.3;  ///< of a measurement's components, > 0
  PatchModel patch = PatchModel::kPlane;
  int refinements =
      3;  ///< Gauss-Newton steps after which the newest frame's features are aligned again, >= 0

  int corner_cell_px = 12;      ///< at most one corner a cell is matched between frames, a positive multiple
                                ///< of 4
  int cell_px = 24;             ///< at most one landmark a cell is started, >= 1
  int corner_threshold = 8;     ///< FAST [grey] >= 1
  float min_corner_score = 20;  ///< Shi-Tomasi [grey^2/px^2] >= 0
  double min_disparity_px = 1;  ///< of a corner: below it a point's distance is a guess, > 0
  double search_share = 0.25;   ///< features of successive frames match within this share of the width, > 0
  double max_sad_ratio = 0.8;   ///< best over second-best sum of differences, in (0, 1)
  ConsistencyOptions consistency;
  int min_matches = 8;         ///< consistent matches and measured landmarks that make a frame tracked, >= 3
  double max_residual_px = 3;  ///< a track farther off its landmark after the update is given up, > 0
  GuidedSearchOptions search;  ///< stereo match of new features, and how alike patches must be

  /// Empty when valid; otherwise names the field, the rule and the value.
  [[nodiscard]] std::string invalid_reason() const;
};

}  // namespace twofold
