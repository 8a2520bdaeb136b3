#include "imaging/fast_corners.hpp"

#ifdef __AVX2__
#include <immintrin.h>
#endif

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
  std::uint32_t bright_ring = 0;
  std::uint32_t dark_ring = 0;
  for (std::size_t i = 0; i < 16; ++i) {
    const int value = p[circle[i]];
    bright_ring |= static_cast<std::uint32_t>(value > high) << i;
    dark_ring |= static_cast<std::uint32_t>(value < low) << i;
  }
  return has_arc_of_nine(bright_ring) || has_arc_of_nine(dark_ring);
}

constexpr int kStrong = 3;  // thresholds that a strong corner stands out by
constexpr int kRun = 32;    // pixels looked at together

/// Bytes that are non-zero where the pixel may be a corner: an arc of nine covers at least two neighbouring
/// compass points, so most pixels end here. Written for the vectoriser: bytes only, no branches.
void may_be_corners(const std::uint8_t* p, std::ptrdiff_t stride, int threshold,
                    std::uint8_t (&flags)[kRun]) {
  const std::uint8_t* north = p - 3 * stride;
  const std::uint8_t* south = p + 3 * stride;
  const auto t = static_cast<std::uint8_t>(threshold);
  const auto room = static_cast<std::uint8_t>(255 - threshold);
  for (int i = 0; i < kRun; ++i) {
    const std::uint8_t c = p[i];
    const auto high = static_cast<std::uint8_t>(c > room ? 255 : c + t);
    const auto low = static_cast<std::uint8_t>(c < t ? 0 : c - t);
    // Nearest of opposite points must be outside on the same side: (n or s) and (e or w).
    const std::uint8_t ns_max = std::max(north[i], south[i]);
    const std::uint8_t ew_max = std::max(p[i + 3], p[i - 3]);
    const std::uint8_t ns_min = std::min(north[i], south[i]);
    const std::uint8_t ew_min = std::min(p[i + 3], p[i - 3]);
    const std::uint8_t bright = std::min(ns_max, ew_max) > high ? 1 : 0;
    const std::uint8_t dark = std::max(ns_min, ew_min) < low ? 1 : 0;
    flags[i] = bright | dark;
  }
}

/// Best corner of the pixels [u0, u1) x [v0, v1).
Corner best_corner(const cv::Mat& image, const Circle& circle, int threshold, int u0, int u1, int v0,
                   int v1) {
  const auto stride = static_cast<std::ptrdiff_t>(image.step);
  Corner best;
  alignas(32) std::uint8_t flags[kRun];
  for (int v = v0; v < v1; ++v) {
    const std::uint8_t* row = image.data + v * stride;
    for (int first = u0; first < u1; first += kRun) {
      // The run may reach past the cell, but not past the row's end.
      const int begin = std::min(first, image.cols - 3 - kRun);
      may_be_corners(row + begin, stride, threshold, flags);
      for (int u = first; u < std::min(first + kRun, u1); ++u) {
        if (flags[u - begin] == 0 || !is_corner(row + u, circle, threshold)) continue;
        const float score = shi_tomasi_score(image, u, v);
        if (score > best.score) best = {static_cast<std::int16_t>(u), static_cast<std::int16_t>(v), 0, score};
      }
    }
  }
  return best;
}

}  // namespace

float shi_tomasi_score(const cv::Mat& image, int u, int v) {
  const auto stride = static_cast<std::ptrdiff_t>(image.step);
  const std::uint8_t* p = image.data + (v - 4) * stride + u - 4;
  int uu = 0;
  int uv = 0;
  int vv = 0;
#ifdef __AVX2__
  const auto eight = [](const std::uint8_t* at) {
    return _mm_cvtepu8_epi16(_mm_loadl_epi64(reinterpret_cast<const __m128i*>(at)));
  };
  __m128i sums_uu = _mm_setzero_si128();
  __m128i sums_uv = _mm_setzero_si128();
  __m128i sums_vv = _mm_setzero_si128();
  for (int r = 0; r < 8; ++r, p += stride) {
    const __m128i gu = _mm_sub_epi16(eight(p + 1), eight(p - 1));
    const __m128i gv = _mm_sub_epi16(eight(p + stride), eight(p - stride));
    sums_uu = _mm_add_epi32(sums_uu, _mm_madd_epi16(gu, gu));
    sums_uv = _mm_add_epi32(sums_uv, _mm_madd_epi16(gu, gv));
    sums_vv = _mm_add_epi32(sums_vv, _mm_madd_epi16(gv, gv));
  }
  const __m128i pairs = _mm_hadd_epi32(sums_uu, sums_uv);
  const __m128i total = _mm_hadd_epi32(pairs, _mm_hadd_epi32(sums_vv, sums_vv));
  uu = _mm_extract_epi32(total, 0);
  uv = _mm_extract_epi32(total, 1);
  vv = _mm_extract_epi32(total, 2);
#else
  for (int r = 0; r < 8; ++r, p += stride) {
    for (int c = 0; c < 8; ++c) {
      const int gu = p[c + 1] - p[c - 1];
      const int gv = p[c + stride] - p[c - stride];
      uu += gu * gu;
      uv += gu * gv;
      vv += gv * gv;
    }
  }
#endif
  // Central differences are twice the gradient: a quarter, over 64 pixels.
  const double scale = 1.0 / (4 * 64);
  const double a = uu * scale;
  const double b = uv * scale;
  const double c = vv * scale;
  return static_cast<float>(0.5 * (a + c - std::sqrt((a - c) * (a - c) + 4 * b * b)));
}

void detect_corners(const cv::Mat& image, int level, int threshold, float min_score, int border,
                    const CellGrid& grid, std::vector<Corner>& corners) {
  if (image.cols < kRun + 6) return;
  const Circle circle = circle_offsets(static_cast<std::ptrdiff_t>(image.step));
  const int cell = grid.cell_px >> level;
  for (int row = 0; row < grid.rows; ++row) {
    const int v0 = std::max(row * cell, border);
    const int v1 = std::min((row + 1) * cell, image.rows - border);
    for (int column = 0; column < grid.columns && v0 < v1; ++column) {
      if (grid.occupied[static_cast<std::size_t>(row * grid.columns + column)] != 0) continue;
      const int u0 = std::max(column * cell, border);
      const int u1 = std::min((column + 1) * cell, image.cols - border);
      if (u0 >= u1) continue;
      // Strong corners first: in rich texture there are enough of them, and far fewer to score.
      Corner best = best_corner(image, circle, kStrong * threshold, u0, u1, v0, v1);
      if (best.score < min_score) best = best_corner(image, circle, threshold, u0, u1, v0, v1);
      best.level = static_cast<std::uint8_t>(level);
      if (best.score >= min_score && corners.size() < corners.capacity()) corners.push_back(best);
    }
  }
}

}  // namespace twofold
