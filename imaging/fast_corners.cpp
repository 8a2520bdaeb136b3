#include "imaging/fast_corners.hpp"

#include <algorithm>
#include <array>
#include <cmath>

namespace twofold {
namespace {

using Circle = std::array<std::ptrdiff_t, 16>;

Circle circle_offsets(std::ptrdiff_t stride) {
  constexpr std::array<std::array<int, 2>, 16> kCircle{{{0, -3},
                                                        {1, -3},
                                                        {2, -2},
                                                        {3, -1},
                                                        {3, 0},
                                                        {3, 1},
                                                        {2, 2},
                                                        {1, 3},
                                                        {0, 3},
                                                        {-1, 3},
                                                        {-2, 2},
                                                        {-3, 1},
                                                        {-3, 0},
                                                        {-3, -1},
                                                        {-2, -2},
                                                        {-1, -3}}};
  Circle offsets{};
  for (std::size_t i = 0; i < 16; ++i) offsets[i] = kCircle[i][1] * stride + kCircle[i][0];
  return offsets;
}

/// Nine ones in a row among the sixteen bits, taken as a ring.
bool has_arc_of_nine(std::uint32_t ring) {
  ring |= ring << 16;
  std::uint32_t run = ring & (ring >> 1);  // two in a row
  run &= run >> 2;                         // four
  run &= run >> 4;                         // eight
  return (run & (ring >> 8)) != 0;
}

bool is_corner(const std::uint8_t* p, const Circle& circle, int threshold) {
  const int high = *p + threshold;
  const int low = *p - threshold;
  // An arc of nine covers at least two of the four compass points: most pixels end here.
  const auto outside = [&](std::size_t i) { return (p[circle[i]] > high) - (p[circle[i]] < low); };
  const int n = outside(0);
  const int s = outside(8);
  const int e = outside(4);
  const int w = outside(12);
  const int brighter = (n > 0) + (s > 0) + (e > 0) + (w > 0);
  const int darker = (n < 0) + (s < 0) + (e < 0) + (w < 0);
  if (brighter < 2 && darker < 2) return false;
  std::uint32_t bright_ring = 0;
  std::uint32_t dark_ring = 0;
  for (std::size_t i = 0; i < 16; ++i) {
    const int value = p[circle[i]];
    bright_ring |= static_cast<std::uint32_t>(value > high) << i;
    dark_ring |= static_cast<std::uint32_t>(value < low) << i;
  }
  return has_arc_of_nine(bright_ring) || has_arc_of_nine(dark_ring);
}

}  // namespace

float shi_tomasi_score(const cv::Mat& image, int u, int v) {
  const auto stride = static_cast<std::ptrdiff_t>(image.step);
  int uu = 0;
  int uv = 0;
  int vv = 0;
  for (int dv = -4; dv < 4; ++dv) {
    const std::uint8_t* p = image.data + (v + dv) * stride + u - 4;
    for (int c = 0; c < 8; ++c) {
      const int gu = p[c + 1] - p[c - 1];
      const int gv = p[c + stride] - p[c - stride];
      uu += gu * gu;
      uv += gu * gv;
      vv += gv * gv;
    }
  }
  // Central differences are twice the gradient: a quarter, over 64 pixels.
  const double scale = 1.0 / (4 * 64);
  const double a = uu * scale;
  const double b = uv * scale;
  const double c = vv * scale;
  return static_cast<float>(0.5 * (a + c - std::sqrt((a - c) * (a - c) + 4 * b * b)));
}

void detect_corners(const cv::Mat& image, int level, int threshold, int border, int cell,
                    std::vector<Corner>& corners) {
  const auto stride = static_cast<std::ptrdiff_t>(image.step);
  const Circle circle = circle_offsets(stride);
  for (int v0 = border; v0 < image.rows - border; v0 += cell) {
    const int v1 = std::min(v0 + cell, image.rows - border);
    for (int u0 = border; u0 < image.cols - border; u0 += cell) {
      const int u1 = std::min(u0 + cell, image.cols - border);
      Corner best;
      for (int v = v0; v < v1; ++v) {
        const std::uint8_t* row = image.data + v * stride;
        for (int u = u0; u < u1; ++u) {
          if (!is_corner(row + u, circle, threshold)) continue;
          const float score = shi_tomasi_score(image, u, v);
          if (score > best.score) {
            best = {static_cast<std::int16_t>(u), static_cast<std::int16_t>(v),
                    static_cast<std::uint8_t>(level), score};
          }
        }
      }
      if (best.score > 0 && corners.size() < corners.capacity()) corners.push_back(best);
    }
  }
}

}  // namespace twofold
