#pragma once

#include <algorithm>
#include <string>
#include <vector>

#include "imaging/binary_descriptor.hpp"
#include "imaging/fast_corners.hpp"

namespace twofold {

/// What a corner must be in the dark: contrast is low there for want of light, and noise is not.
struct FaintCornerOptions {
  double dark_below = 60;        ///< mean brightness of an image that is dark [grey] > 0
  double threshold_share = 0.5;  ///< of the usual FAST threshold, in (0, 1]
  double score_share = 0.25;     ///< of the usual least score, in (0, 1]

  [[nodiscard]] int threshold(int usual) const {
    return std::max(static_cast<int>(threshold_share * usual), 1);
  }
  [[nodiscard]] float score(float usual) const { return static_cast<float>(score_share) * usual; }

  /// Empty when valid; otherwise names the field, the rule and the value.
  [[nodiscard]] std::string invalid_reason() const;
};

struct CornerSelectionOptions {
  int wanted = 500;     ///< corners of a keyframe at most, over all levels, >= 1 (thesis 6.4.2: 500 to 2000)
  int levels = 3;       ///< pyramid levels searched, in [1, 3]
  int threshold = 8;    ///< FAST [grey] >= 1
  float min_score = 6;  ///< Shi-Tomasi, see Corner, >= 0
  FaintCornerOptions faint = {};  ///< in the dark

  /// Empty when valid; otherwise names the field, the rule and the value.
  [[nodiscard]] std::string invalid_reason() const;
};

/// Picks the corners of an image that describe its place: each level is parted into cells, each cell gives
/// its best corner, so that a busy corner of the image does not speak for the rest; the strongest are kept.
/// A level gets cells in proportion to its share of the corners wanted, half as many as the level below. In
/// the dark, where corners are missing, higher levels give fainter ones in their place.
///
/// Keeps buffers between calls; one instance a thread.
class CornerSelector {
 public:
  explicit CornerSelector(const CornerSelectionOptions& options);

  /// Corners without angle and descriptor, strongest first within a level, levels ascending. All of them are
  /// far enough from the border of their level to be described.
  void select(const ImagePyramid& pyramid, std::vector<DescribedCorner>& corners);

 private:
  /// Which corners are good enough.
  struct Bounds {
    int threshold = 0;
    float min_score = 0;
  };

  void add(const ImagePyramid& pyramid, int level, int wanted, const Bounds& bounds,
           std::vector<DescribedCorner>& corners);
  void add_faint(const ImagePyramid& pyramid, std::vector<DescribedCorner>& corners);

  CornerSelectionOptions options_;
  std::vector<Corner> found_;
  std::vector<std::uint8_t> occupied_;
};

}  // namespace twofold
