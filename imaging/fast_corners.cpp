#include "imaging/fast_corners.hpp"

#ifdef __AVX2__
#include <immintrin.h>
#endif

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>

#include "geometry/check.hpp"

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

constexpr int kRun = 32;    // pixels looked at together
constexpr int kStrong = 3;  // thresholds that a strong corner stands out by

/// One byte a pixel; comparisons give 255 or 0.
using Bytes = std::uint8_t __attribute__((vector_size(kRun)));

Bytes load(const std::uint8_t* p) {
  Bytes bytes;
  std::memcpy(&bytes, p, sizeof bytes);
  return bytes;
}
Bytes larger(Bytes a, Bytes b) {
  return a > b ? a : b;
}
Bytes smaller(Bytes a, Bytes b) {
  return a < b ? a : b;
}
/// Bit k set where byte k is not zero; marks are 255 or 0.
std::uint32_t mask_of(const Bytes& marks) {
#ifdef __AVX2__
  __m256i bytes;
  std::memcpy(&bytes, &marks, sizeof bytes);
  return static_cast<std::uint32_t>(_mm256_movemask_epi8(bytes));
#else
  std::uint32_t mask = 0;
  for (int k = 0; k < kRun; ++k) mask |= (marks[k] != 0 ? 1U : 0U) << k;
  return mask;
#endif
}

/// How far the weakest of the nine pixels of an arc stands out, for the arc of which it is most: `d` are the
/// differences around the circle. Arcs k and k + 1 share eight pixels.
Bytes strongest_arc(const std::array<Bytes, 16>& d) {
  std::array<Bytes, 8> two, four;
  for (std::size_t i = 0; i < 8; ++i) two[i] = smaller(d[2 * i + 1], d[(2 * i + 2) % 16]);
  for (std::size_t i = 0; i < 8; ++i) four[i] = smaller(two[i], two[(i + 1) % 8]);
  Bytes strongest{};
  for (std::size_t i = 0; i < 8; ++i) {
    const Bytes shared = smaller(four[i], four[(i + 2) % 8]);
    strongest = larger(strongest, smaller(shared, larger(d[2 * i], d[(2 * i + 9) % 16])));
  }
  return strongest;
}

/// How far each pixel of the run stands out as a corner; 0 for those that are none.
Bytes strength_in_run(const std::uint8_t* p, const Circle& circle, int threshold) {
  const Bytes centre = load(p);
  const Bytes t = Bytes{} + static_cast<std::uint8_t>(threshold);
  const auto brighter = [&](Bytes q) { return larger(q, centre) - centre; };
  const auto darker = [&](Bytes q) { return centre - smaller(q, centre); };
  // An arc of nine covers two neighbouring compass points at least: most runs end here.
  const Bytes n = load(p + circle[0]), e = load(p + circle[4]);
  const Bytes s = load(p + circle[8]), w = load(p + circle[12]);
  const Bytes may_be_bright = brighter(smaller(larger(n, s), larger(e, w))) > t;
  const Bytes may_be_dark = darker(larger(smaller(n, s), smaller(e, w))) > t;

  Bytes strength{};
  std::array<Bytes, 16> d;
  if (mask_of(may_be_bright) != 0) {
    for (std::size_t k = 0; k < 16; ++k) d[k] = brighter(load(p + circle[k]));
    strength = strongest_arc(d);
  }
  if (mask_of(may_be_dark) != 0) {
    for (std::size_t k = 0; k < 16; ++k) d[k] = darker(load(p + circle[k]));
    strength = larger(strength, strongest_arc(d));
  }
  return strength & static_cast<Bytes>(strength > t);
}

constexpr int kMaxColumns = 256;
constexpr int kMaxMasks = 1 << 14;  // of one strip: 128 rows of 4096 pixels

/// One row of cells on one pyramid level, and the best corner found in each so far.
struct Strip {
  const cv::Mat& image;
  const Circle circle;
  int cell;    // side in pixels of the level
  int u0, u1;  // columns and rows of pixels looked at
  int v0, v1;
  std::span<std::uint32_t> weak;  // by run and row: corners that do not stand out far
  std::array<bool, kMaxColumns> wanted{};
  std::array<Corner, kMaxColumns> best{};

  /// Any cell wanted that has pixels in [first, end)?
  [[nodiscard]] bool wants(int first, int end) const {
    for (int column = first / cell; column <= (end - 1) / cell; ++column) {
      if (wanted[static_cast<std::size_t>(column)]) return true;
    }
    return false;
  }
  [[nodiscard]] std::uint32_t& weak_at(int first, int v) {
    return weak[static_cast<std::size_t>((first - u0) / kRun * (v1 - v0) + v - v0)];
  }
  /// The last run starts earlier, so that it does not reach past the row's end.
  [[nodiscard]] int begin_of(int first) const { return std::min(first, image.cols - 3 - kRun); }

  void judge(int u, int v) {
    const auto column = static_cast<std::size_t>(u / cell);
    if (!wanted[column]) return;
    const float score = shi_tomasi_score(image, u, v);
    if (score > best[column].score) {
      best[column] = {static_cast<std::int16_t>(u), static_cast<std::int16_t>(v), 0, score};
    }
  }

  void judge_all(std::uint32_t mask, int first, int v) {
    const int begin = begin_of(first);
    for (; mask != 0; mask &= mask - 1) {
      const int u = begin + __builtin_ctz(mask);
      if (u >= first && u < std::min(first + kRun, u1)) judge(u, v);
    }
  }

  /// Finds all corners; judges those that stand out by more than `strong` and keeps the others for later.
  void scan(int threshold, int strong) {
    const Bytes far = Bytes{} + static_cast<std::uint8_t>(std::min(strong, 255));
    for (int first = u0; first < u1; first += kRun) {
      if (v0 >= v1 || !wants(first, std::min(first + kRun, u1))) continue;
      for (int v = v0; v < v1; ++v) {
        const Bytes found = strength_in_run(image.ptr<std::uint8_t>(v) + begin_of(first), circle, threshold);
        const std::uint32_t strong_ones = mask_of(static_cast<Bytes>(found > far));
        weak_at(first, v) = mask_of(static_cast<Bytes>(found > Bytes{})) & ~strong_ones;
        judge_all(strong_ones, first, v);
      }
    }
  }

  /// Judges what scan kept for later, of the cells still wanted.
  void judge_weak() {
    for (int first = u0; first < u1; first += kRun) {
      if (!wants(first, std::min(first + kRun, u1))) continue;
      for (int v = v0; v < v1; ++v) judge_all(weak_at(first, v), first, v);
    }
  }
};

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
  TWOFOLD_CHECK(grid.columns <= kMaxColumns, "image too wide for cells of this size");
  if (image.cols < kRun + 2 * border) return;
  const int cell = grid.cell_px >> level;
  const Circle circle = circle_offsets(static_cast<std::ptrdiff_t>(image.step));
  TWOFOLD_CHECK((image.cols / kRun + 1) * cell <= kMaxMasks, "cells too large for an image so wide");
  std::array<std::uint32_t, kMaxMasks> weak;
  for (int row = 0; row < grid.rows; ++row) {
    Strip strip{image,
                circle,
                cell,
                border,
                std::min(grid.columns * cell, image.cols - border),
                std::max(row * cell, border),
                std::min((row + 1) * cell, image.rows - border),
                weak};
    const std::uint8_t* occupied = grid.occupied.data() + row * grid.columns;
    for (int c = 0; c < grid.columns; ++c) strip.wanted[static_cast<std::size_t>(c)] = occupied[c] == 0;
    // Strong corners first: in rich texture there are enough of them, and far fewer to score.
    strip.scan(threshold, kStrong * threshold);
    for (std::size_t c = 0; c < static_cast<std::size_t>(grid.columns); ++c) {
      strip.wanted[c] = strip.wanted[c] && !(strip.best[c].score > 0 && strip.best[c].score >= min_score);
    }
    strip.judge_weak();
    for (std::size_t c = 0; c < static_cast<std::size_t>(grid.columns); ++c) {
      Corner corner = strip.best[c];
      corner.level = static_cast<std::uint8_t>(level);
      if (corner.score > 0 && corner.score >= min_score && corners.size() < corners.capacity())
        corners.push_back(corner);
    }
  }
}

}  // namespace twofold
