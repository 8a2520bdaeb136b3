#pragma once

#include <string>

#include "tracking/loss/loss_history.hpp"
#include "tracking/loss/wide_search.hpp"

namespace twofold {

/// What a lost camera is compared with, and when it starts anew.
struct LossOptions {
  WideSearchOptions wide_search;
  LossSignOptions signs;
  int recent_keyframes = 4;  ///< whose images a lost camera is compared with, and depth aligned to, in [1,
                             ///< DepthAlignment::kViews]
  /// Lost frames, from which on the camera is first looked for where it would be had it gone on, >= 1: after
  /// a single one it cannot be far from where it was.
  int coast_after = 2;
  double new_part_after = 1;  ///< lost for so long while corners are seen: a new map part is started [s] >= 0
  int new_part_frames = 5;    ///< ... and for so many frames, >= 0
  int min_corners_seen = 40;  ///< corners, >= 0; fewer: the lens is covered, or there is nothing to see

  /// Empty when valid; otherwise names the field, the rule and the value.
  [[nodiscard]] std::string invalid_reason() const;
};

}  // namespace twofold
