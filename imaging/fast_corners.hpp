#pragma once

#include <cstdint>
#include <opencv2/core/mat.hpp>
#include <vector>

namespace twofold {

struct Corner {
  std::int16_t u = 0;  ///< whole pixel of the image it was found in
  std::int16_t v = 0;
  std::uint8_t level = 0;
  float score = 0;  ///< Shi-Tomasi: smaller eigenvalue of the 8x8 structure tensor [grey^2/px^2], per pixel
};

/// FAST-9 corners (Rosten and Drummond, ECCV 2006): nine of the sixteen pixels on the circle of radius 3 in a
/// row are all brighter or all darker than the centre by `threshold`. Each cell of `cell` x `cell` pixels
/// keeps its corner of highest score, which spreads them and thins neighbours out.
///
/// Appends to `corners`, never beyond its capacity (no allocation). `border`: pixels left out along the
/// edges, >= 8.
void detect_corners(const cv::Mat& image, int level, int threshold, int border, int cell,
                    std::vector<Corner>& corners);

/// Score of a corner; (u, v) at least 5 pixels inside.
[[nodiscard]] float shi_tomasi_score(const cv::Mat& image, int u, int v);

}  // namespace twofold
