#pragma once

#include <string>

#include "tracking/monocular/corner_following.hpp"
#include "tracking/monocular/first_structure.hpp"
#include "tracking/monocular/wide_following.hpp"

namespace twofold {

/// How one camera starts (tracking/monocular_start.hpp): which earlier frames its first motion is
/// looked for from, and what must come of them.
struct MonocularStartOptions {
  int candidates = 4;           ///< earlier frames tried, the oldest being left out, >= 1
  int frames_between = 4;       ///< of a candidate and now, that tell motions apart, >= 2
  int longest_path = 64;        ///< frames since a candidate that get their poses afterwards, >= 2
  double placed_share = 0.6;    ///< of the start's points, that must agree on such a pose, in (0, 1]
  double next_flow = 0.03;      ///< share of the image's width that corners have moved by: a new candidate is
                                ///< worth its place, >= 0
  double min_left_share = 0.4;  ///< of its corners: a candidate with fewer is given up, in (0, 1]
  CornerFollowingOptions following;
  WideFollowingOptions wide_following;
  FirstStructureOptions first_structure;

  /// Empty when valid; otherwise names the field, the rule and the value.
  [[nodiscard]] std::string invalid_reason() const;
};

}  // namespace twofold
