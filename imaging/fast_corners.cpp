#include "imaging/fast_corners.hpp"

#include <algorithm>
#include <array>
#include <cmath>

#include "base/check.hpp"
#include "imaging/byte_run.hpp"
#include "imaging/structure_tensor.hpp"

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

constexpr int kRun = kByteRun;  // pixels looked at together
constexpr int kStrong = 3;      // thresholds that a strong corner stands out by

/// Over the sixteen arcs of nine neighbours on the circle: the largest of their smallest pixels. `inner` and
/// `outer` are smaller and larger; the other way round, the smallest of their largest. Arcs k and k + 1 share
/// eight pixels.
template <ByteRun (*inner)(ByteRun, ByteRun), ByteRun (*outer)(ByteRun, ByteRun)>
ByteRun best_arc(const std::array<ByteRun, 16>& q) {
  std::array<ByteRun, 8> two, four;
  for (std::size_t i = 0; i < 8; ++i) two[i] = inner(q[2 * i + 1], q[(2 * i + 2) % 16]);
  for (std::size_t i = 0; i < 8; ++i) four[i] = inner(two[i], two[(i + 1) % 8]);
  ByteRun best = inner(inner(four[0], four[2]), outer(q[0], q[9]));
  for (std::size_t i = 1; i < 8; ++i) {
    const ByteRun shared = inner(four[i], four[(i + 2) % 8]);
    best = outer(best, inner(shared, outer(q[2 * i], q[(2 * i + 9) % 16])));
  }
  return best;
}

/// How far each pixel of the run stands out as a corner, by the weakest pixel of the arc that does most; 0
/// for those that are none.
ByteRun strength_in_run(const std::uint8_t* p, const Circle& circle, int threshold) {
  const ByteRun centre = load_run(p);
  const ByteRun t = run_of(static_cast<std::uint8_t>(threshold));
  const auto brighter = [&](ByteRun q) { return larger(q, centre) - centre; };
  const auto darker = [&](ByteRun q) { return centre - smaller(q, centre); };
  // An arc of nine covers two neighbouring compass points at least: most runs end here.
  const ByteRun n = load_run(p + circle[0]), e = load_run(p + circle[4]);
  const ByteRun s = load_run(p + circle[8]), w = load_run(p + circle[12]);
  const bool may_be_bright = any_of(above(brighter(smaller(larger(n, s), larger(e, w))), t));
  const bool may_be_dark = any_of(above(darker(larger(smaller(n, s), smaller(e, w))), t));

  ByteRun strength = run_of(0);
  if (!may_be_bright && !may_be_dark) return strength;
  std::array<ByteRun, 16> q;
  for (std::size_t k = 0; k < 16; ++k) q[k] = load_run(p + circle[k]);
  if (may_be_bright) strength = brighter(best_arc<smaller, larger>(q));
  if (may_be_dark) strength = larger(strength, darker(best_arc<larger, smaller>(q)));
  return strength & above(strength, t);
}

constexpr double kPerPixel = 1.0 / (4 * 64);  // from a StructureTensor's eigenvalue to a score

constexpr int kMaxMasks = 1 << 14;  // kept of one strip: 128 rows of 4096 pixels

/// One row of cells on one pyramid level, and the best corner found in each so far.
struct Strip {
  const cv::Mat& image;
  const Circle circle;
  int cell;    // side in pixels of the level
  int u0, u1;  // columns and rows of pixels looked at
  int v0, v1;
  int threshold, far;             // of grey levels by which corners stand out, and stand out far
  std::span<std::uint32_t> weak;  // by run and row: corners that do not stand out far; empty: not kept
  struct Best {
    int u = 0, v = 0;
    double eigenvalue = 0;
  };
  std::array<bool, CellGrid::kMaxColumns> wanted{};
  std::array<Best, CellGrid::kMaxColumns> best{};

  /// Pixels [begin, begin + kRun) of the strip's rows: the cell of each, and those in wanted cells that no
  /// run before has looked at.
  struct Run {
    int begin = 0;
    std::uint32_t wanted = 0;
    std::array<std::uint8_t, kRun> column{};
  };
  [[nodiscard]] Run run_at(int first) const {
    Run run;
    // The last run starts earlier, so that it does not reach past the row's end.
    run.begin = std::min(first, image.cols - 3 - kRun);
    int column = first / cell;
    for (int u = first; u < std::min(run.begin + kRun, u1); ++u) {
      if (u == (column + 1) * cell) ++column;
      const auto k = static_cast<std::size_t>(u - run.begin);
      run.column[k] = static_cast<std::uint8_t>(column);
      if (wanted[run.column[k]]) run.wanted |= 1U << k;
    }
    return run;
  }
  [[nodiscard]] std::uint32_t& weak_at(int first, int v) {
    return weak[static_cast<std::size_t>((first - u0) / kRun * (v1 - v0) + v - v0)];
  }

  void judge(std::uint32_t corners, const Run& run, int v) {
    // All tensors before the first comparison: a mispredicted one then waits for none of them.
    std::array<StructureTensor, kRun> tensors;
    std::size_t count = 0;
    for (std::uint32_t left = corners; left != 0; left &= left - 1) {
      tensors[count++] = structure_tensor(image, run.begin + __builtin_ctz(left), v);
    }
    for (std::size_t i = 0; i < count; ++i, corners &= corners - 1) {
      const int k = __builtin_ctz(corners);
      Best& so_far = best[run.column[static_cast<std::size_t>(k)]];
      if (!tensors[i].exceeds(so_far.eigenvalue)) continue;
      so_far = {run.begin + k, v, tensors[i].smaller_eigenvalue()};
    }
  }

  /// Corners of a run's pixels in row v.
  struct Found {
    std::uint32_t strong, weak;
  };
  [[nodiscard]] Found find(const Run& run, int v) const {
    const ByteRun found = strength_in_run(image.ptr<std::uint8_t>(v) + run.begin, circle, threshold);
    const std::uint32_t strong = mask_of(above(found, run_of(static_cast<std::uint8_t>(far))));
    return {strong, mask_of(above(found, run_of(0))) & ~strong};
  }

  /// Judges the corners that stand out far, and keeps the others for later.
  void judge_strong() {
    for (int first = u0; first < u1; first += kRun) {
      const Run run = run_at(first);
      if (run.wanted == 0) continue;
      for (int v = v0; v < v1; ++v) {
        const Found found = find(run, v);
        if (!weak.empty()) weak_at(first, v) = found.weak;
        judge(found.strong & run.wanted, run, v);
      }
    }
  }

  /// Judges the others, of the cells still wanted. Where there was no room to keep them they are found again.
  void judge_weak() {
    for (int first = u0; first < u1; first += kRun) {
      const Run run = run_at(first);
      for (int v = v0; v < v1 && run.wanted != 0; ++v) {
        const std::uint32_t corners = weak.empty() ? find(run, v).weak : weak_at(first, v);
        judge(corners & run.wanted, run, v);
      }
    }
  }
};

}  // namespace

void detect_corners(const cv::Mat& image, int level, int threshold, float min_score, int border,
                    const CellGrid& grid, std::vector<Corner>& corners) {
  TWOFOLD_CHECK(grid.columns <= CellGrid::kMaxColumns, "image too wide for cells of this size");
  TWOFOLD_CHECK(level >= 0 && level <= 2 && grid.cell_px % 4 == 0, "cells are whole pixels on levels 0 to 2");
  if (image.cols < kRun + 2 * border) return;
  const int cell = grid.cell_px >> level;
  const Circle circle = circle_offsets(static_cast<std::ptrdiff_t>(image.step));
  std::array<std::uint32_t, kMaxMasks> weak;
  const bool room = (image.cols / kRun + 1) * cell <= kMaxMasks;
  for (int row = 0; row < grid.rows; ++row) {
    Strip strip{image,
                circle,
                cell,
                border,
                std::min(grid.columns * cell, image.cols - border),
                std::max(row * cell, border),
                std::min((row + 1) * cell, image.rows - border),
                threshold,
                std::min(kStrong * threshold, 255),
                room ? std::span<std::uint32_t>(weak) : std::span<std::uint32_t>()};
    const std::uint8_t* occupied = grid.occupied.data() + row * grid.columns;
    for (int c = 0; c < grid.columns; ++c) strip.wanted[static_cast<std::size_t>(c)] = occupied[c] == 0;
    // Strong corners first: in rich texture there are enough of them, and far fewer to score.
    strip.judge_strong();
    const double enough = std::max(min_score / kPerPixel, 1.0);
    for (std::size_t c = 0; c < static_cast<std::size_t>(grid.columns); ++c) {
      strip.wanted[c] = strip.wanted[c] && strip.best[c].eigenvalue < enough;
    }
    strip.judge_weak();
    for (std::size_t c = 0; c < static_cast<std::size_t>(grid.columns); ++c) {
      const Strip::Best& best = strip.best[c];
      if (best.eigenvalue < enough || corners.size() == corners.capacity()) continue;
      corners.push_back({static_cast<std::int16_t>(best.u), static_cast<std::int16_t>(best.v),
                         static_cast<std::uint8_t>(level), static_cast<float>(best.eigenvalue * kPerPixel)});
    }
  }
}

}  // namespace twofold
