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
bool any(Bytes bytes) {
  std::uint64_t words[kRun / 8];
  std::memcpy(words, &bytes, sizeof words);
  return (words[0] | words[1] | words[2] | words[3]) != 0;
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
  if (any(may_be_bright)) {
    for (std::size_t k = 0; k < 16; ++k) d[k] = brighter(load(p + circle[k]));
    strength = strongest_arc(d);
  }
  if (any(may_be_dark)) {
    for (std::size_t k = 0; k < 16; ++k) d[k] = darker(load(p + circle[k]));
    strength = larger(strength, strongest_arc(d));
  }
  return strength & static_cast<Bytes>(strength > t);
}

constexpr int kMaxColumns = 256;

/// One row of cells on one pyramid level, and the best corner found in each so far.
struct Strip {
  const cv::Mat& image;
  const Circle circle;
  int cell;    // side in pixels of the level
  int u0, u1;  // columns and rows of pixels looked at
  int v0, v1;
  std::array<bool, kMaxColumns> wanted{};
  std::array<Corner, kMaxColumns> best{};

  /// Any cell wanted that has pixels in [first, end)?
  [[nodiscard]] bool wants(int first, int end) const {
    for (int column = first / cell; column <= (end - 1) / cell; ++column) {
      if (wanted[static_cast<std::size_t>(column)]) return true;
    }
    return false;
  }

  void judge(int u, int v) {
    const auto column = static_cast<std::size_t>(u / cell);
    if (!wanted[column]) return;
    const float score = shi_tomasi_score(image, u, v);
    if (score > best[column].score) {
      best[column] = {static_cast<std::int16_t>(u), static_cast<std::int16_t>(v), 0, score};
    }
  }

  /// Those of [first, end) that are marked in the run that starts at `begin`.
  void judge_run(const Bytes& marked, int begin, int first, int end, int v) {
    std::uint64_t words[kRun / 8];
    std::memcpy(words, &marked, sizeof words);
    for (int word = 0; word < kRun / 8; ++word) {
      for (std::uint64_t left = words[word]; left != 0;) {
        const int byte = __builtin_ctzll(left) / 8;
        left &= ~(std::uint64_t{0xff} << (8 * byte));
        const int u = begin + 8 * word + byte;
        if (u >= first && u < end) judge(u, v);
      }
    }
  }

  void scan(int threshold) {
    if (v0 >= v1) return;
    for (int first = u0; first < u1; first += kRun) {
      const int end = std::min(first + kRun, u1);
      if (!wants(first, end)) continue;
      // The last run starts earlier, so that it does not reach past the row's end.
      const int begin = std::min(first, image.cols - 3 - kRun);
      Bytes above{};
      Bytes here = strength_in_run(image.ptr<std::uint8_t>(v0) + begin, circle, threshold);
      for (int v = v0; v < v1; ++v) {
        Bytes below{};
        if (v + 1 < v1) below = strength_in_run(image.ptr<std::uint8_t>(v + 1) + begin, circle, threshold);
        // Corners come in clusters: only those that stand out from their column are worth a score.
        judge_run(static_cast<Bytes>(here > above) & static_cast<Bytes>(here >= below), begin, first, end, v);
        above = here;
        here = below;
      }
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
  for (int row = 0; row < grid.rows; ++row) {
    Strip strip{image,
                circle,
                cell,
                border,
                std::min(grid.columns * cell, image.cols - border),
                std::max(row * cell, border),
                std::min((row + 1) * cell, image.rows - border)};
    const std::uint8_t* occupied = grid.occupied.data() + row * grid.columns;
    for (int c = 0; c < grid.columns; ++c) strip.wanted[static_cast<std::size_t>(c)] = occupied[c] == 0;
    // Strong corners first: in rich texture there are enough of them, and far fewer to score.
    strip.scan(kStrong * threshold);
    for (std::size_t c = 0; c < static_cast<std::size_t>(grid.columns); ++c) {
      strip.wanted[c] = strip.wanted[c] && !(strip.best[c].score > 0 && strip.best[c].score >= min_score);
    }
    strip.scan(threshold);
    for (std::size_t c = 0; c < static_cast<std::size_t>(grid.columns); ++c) {
      Corner corner = strip.best[c];
      corner.level = static_cast<std::uint8_t>(level);
      if (corner.score > 0 && corner.score >= min_score && corners.size() < corners.capacity())
        corners.push_back(corner);
    }
  }
}

}  // namespace twofold
