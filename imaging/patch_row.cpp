#if defined(__AVX2__)
#include <immintrin.h>
#elif defined(__aarch64__)
#include <arm_neon.h>
#endif

#include <array>
#include <cstring>
#include <utility>

#include "base/check.hpp"
#include "imaging/patch.hpp"

namespace twofold {
namespace {

constexpr int kSize = Patch::kSize;
constexpr int kMaxColumns = kMaxRowCosts + kSize - 1;

constexpr int kTogether = 16;  // columns summed at once
constexpr int kRoom = (kMaxColumns + kTogether - 1) / kTogether * kTogether;

using Bytes = std::uint8_t __attribute__((vector_size(kTogether)));
using Words = std::uint16_t __attribute__((vector_size(kTogether * 2)));
using Ints = std::int32_t __attribute__((vector_size(kTogether * 4)));

/// Sums and sums of squares of the image under the patch at every position: by columns, then over eight of
/// them. Reads whole stretches of 16 columns, and then a last one that ends with the last column.
struct BoxSums {
  alignas(64) std::array<std::int32_t, kRoom> sum;
  alignas(64) std::array<std::int32_t, kRoom> squares;

  BoxSums(const std::uint8_t* first, std::ptrdiff_t stride, int columns) {
    for (int next = 0; next < columns; next += kTogether) {
      sum_columns(first, stride, std::min(next, std::max(columns - kTogether, 0)));
    }
    for (int apart = 1; apart < kSize; apart *= 2) {
      columns -= apart;
      for (int x = 0; x < columns; ++x) {
        sum[static_cast<std::size_t>(x)] += sum[static_cast<std::size_t>(x + apart)];
        squares[static_cast<std::size_t>(x)] += squares[static_cast<std::size_t>(x + apart)];
      }
    }
  }

 private:
  void sum_columns(const std::uint8_t* first, std::ptrdiff_t stride, int x) {
    Words total{};
    Ints total_squares{};
    for (int r = 0; r < kSize; ++r) {
      Bytes bytes;
      std::memcpy(&bytes, first + r * stride + x, sizeof bytes);
      const Words pixels = __builtin_convertvector(bytes, Words);
      total += pixels;
      total_squares += __builtin_convertvector(pixels * pixels, Ints);
    }
    const Ints wide = __builtin_convertvector(total, Ints);
    std::memcpy(&sum[static_cast<std::size_t>(x)], &wide, sizeof wide);
    std::memcpy(&squares[static_cast<std::size_t>(x)], &total_squares, sizeof total_squares);
  }
};

constexpr int kAtOnce = 8;

/// Correlation of the patch with the image at eight neighbouring positions; `first` is the pixel under the
/// patch's first entry at the first of them.
#if defined(__AVX2__)
struct Correlator {
  __m256i pairs[kSize / 2];  // pick the pixels (c, c+1), (c+1, c+2), ... of a row as 16-bit values
  std::array<std::int32_t, Patch::kArea / 2> weights;  // two neighbouring entries of the patch each

  explicit Correlator(const Patch& patch) {
    for (int c = 0; c < kSize; c += 2) {
      alignas(32) std::int8_t mask[32];
      for (int i = 0; i < 16; ++i) {
        mask[2 * i] = static_cast<std::int8_t>(c + i / 2 + i % 2);
        mask[2 * i + 1] = -1;
      }
      pairs[c / 2] = _mm256_load_si256(reinterpret_cast<const __m256i*>(mask));
    }
    std::memcpy(weights.data(), patch.rounded, sizeof weights);
  }

  void operator()(const std::uint8_t* first, std::ptrdiff_t stride, int* correlation) const {
    __m256i total = _mm256_setzero_si256();
    for (std::size_t r = 0; r < kSize; ++r, first += stride) {
      const __m256i row =
          _mm256_broadcastsi128_si256(_mm_loadu_si128(reinterpret_cast<const __m128i*>(first)));
      for (std::size_t c = 0; c < kSize / 2; ++c) {
        const __m256i pixels = _mm256_shuffle_epi8(row, pairs[c]);
        total = _mm256_add_epi32(total,
                                 _mm256_madd_epi16(pixels, _mm256_set1_epi32(weights[r * (kSize / 2) + c])));
      }
    }
    _mm256_storeu_si256(reinterpret_cast<__m256i*>(correlation), total);
  }
};
#elif defined(__aarch64__)
class Correlator {
 public:
  explicit Correlator(const Patch& patch) : rows_(patch.rounded) {}

  void operator()(const std::uint8_t* first, std::ptrdiff_t stride, int* correlation) const {
    Totals totals{vdupq_n_s32(0), vdupq_n_s32(0)};
    for (int r = 0; r < kSize; ++r, first += stride) {
      const uint8x16_t row = vld1q_u8(first);
      add_row(totals, vreinterpretq_s16_u16(vmovl_u8(vget_low_u8(row))),
              vreinterpretq_s16_u16(vmovl_high_u8(row)), vld1q_s16(rows_ + r * kSize),
              std::make_integer_sequence<int, kSize>());
    }
    vst1q_s32(correlation, totals.low);
    vst1q_s32(correlation + 4, totals.high);
  }

 private:
  struct Totals {
    int32x4_t low, high;  // of positions 0 to 3 and 4 to 7
  };
  /// Sixteen pixels of a row in two halves, and the patch's row; which lane is taken has to be a constant.
  template <int... columns>
  static void add_row(Totals& totals, int16x8_t left, int16x8_t right, int16x8_t weights,
                      std::integer_sequence<int, columns...>) {
    (add_column<columns>(totals, vextq_s16(left, right, columns), weights), ...);
  }
  template <int column>
  static void add_column(Totals& totals, int16x8_t pixels, int16x8_t weights) {
    totals.low = vmlal_laneq_s16(totals.low, vget_low_s16(pixels), weights, column);
    totals.high = vmlal_high_laneq_s16(totals.high, pixels, weights, column);
  }

  const std::int16_t* rows_;
};
#else
struct Correlator {
  const Patch& patch;
  explicit Correlator(const Patch& p) : patch(p) {}

  void operator()(const std::uint8_t* first, std::ptrdiff_t stride, int* correlation) const {
    for (int i = 0; i < 8; ++i) {
      correlation[i] = 0;
      for (int r = 0; r < kSize; ++r) {
        for (int c = 0; c < kSize; ++c)
          correlation[i] += first[r * stride + c + i] * patch.rounded[r * kSize + c];
      }
    }
  }
};
#endif

}  // namespace

namespace {

#if defined(__AVX2__)
/// For each pair of columns: picks the pixels (c, c+1), (c+1, c+2), ... of a row as 16-bit values.
struct PairMasks {
  alignas(32) std::array<std::array<std::int8_t, 32>, kSize / 2> of;

  constexpr PairMasks() : of{} {
    for (std::size_t pair = 0; pair < of.size(); ++pair) {
      for (std::size_t i = 0; i < 32; ++i)
        of[pair][i] = i % 2 == 0 ? static_cast<std::int8_t>(2 * pair + i / 4 + i / 2 % 2) : std::int8_t{-1};
    }
  }
};
constexpr PairMasks kPairMasks;

/// zero_mean_ssd at eight neighbouring positions, for rows too short for sums of columns to be shared.
void eight_costs(const Patch& patch, const std::uint8_t* first, std::ptrdiff_t stride, int* cost) {
  __m256i sums = _mm256_setzero_si256();
  __m256i squares = _mm256_setzero_si256();
  const std::int16_t* t = patch.rounded;
#pragma GCC unroll 8
  for (int r = 0; r < kSize; ++r, first += stride) {
    const __m256i row = _mm256_broadcastsi128_si256(_mm_loadu_si128(reinterpret_cast<const __m128i*>(first)));
    __m256i of_row = _mm256_setzero_si256();  // sums of 4 differences
#pragma GCC unroll 4
    for (std::size_t pair = 0; pair < kSize / 2; ++pair, t += 2) {
      std::int32_t two;
      std::memcpy(&two, t, sizeof two);
      const __m256i mask = _mm256_load_si256(reinterpret_cast<const __m256i*>(kPairMasks.of[pair].data()));
      const __m256i d = _mm256_sub_epi16(_mm256_shuffle_epi8(row, mask), _mm256_set1_epi32(two));
      of_row = _mm256_add_epi16(of_row, d);
      squares = _mm256_add_epi32(squares, _mm256_madd_epi16(d, d));
    }
    sums = _mm256_add_epi32(sums, _mm256_madd_epi16(of_row, _mm256_set1_epi16(1)));
  }
  static_assert(Patch::kArea == 1 << 6);
  const __m256i of_mean = _mm256_srli_epi32(_mm256_mullo_epi32(sums, sums), 6);
  _mm256_storeu_si256(reinterpret_cast<__m256i*>(cost), _mm256_sub_epi32(squares, of_mean));
}
#endif

/// Of fewer positions than columns are summed at once.
void short_row(const Patch& patch, const cv::Mat& image, int u, int v, std::span<int> cost) {
  const auto count = static_cast<int>(cost.size());
#if defined(__AVX2__)
  if (count >= kAtOnce) {
    const auto stride = static_cast<std::ptrdiff_t>(image.step);
    const std::uint8_t* first = image.data + (v - Patch::kCentre) * stride + (u - Patch::kCentre);
    eight_costs(patch, first, stride, cost.data());
    const int rest = count - kAtOnce;
    if (rest > 0) eight_costs(patch, first + rest, stride, cost.data() + rest);  // some of them once more
    return;
  }
#endif
  for (int i = 0; i < count; ++i) cost[static_cast<std::size_t>(i)] = zero_mean_ssd(patch, image, u + i, v);
}

}  // namespace

// Sum (q - t)^2 = sum q^2 - 2 sum q t + sum t^2: the first is shared by neighbours, the last by all.
void zero_mean_ssd_row(const Patch& patch, const cv::Mat& image, int u, int v, std::span<int> cost) {
  const auto count = static_cast<int>(cost.size());
  TWOFOLD_CHECK(count <= kMaxRowCosts, "a longer stretch of a row than there is room for");
  if (count < kTogether) {
    short_row(patch, image, u, v, cost);
    return;
  }
  const auto stride = static_cast<std::ptrdiff_t>(image.step);
  const std::uint8_t* first = image.data + (v - Patch::kCentre) * stride + (u - Patch::kCentre);
  int patch_sum = 0;
  int patch_squares = 0;
  for (const int t : patch.rounded) {
    patch_sum += t;
    patch_squares += t * t;
  }
  const BoxSums box(first, stride, count + kSize - 1);
  const Correlator correlate(patch);
  std::array<int, kAtOnce> correlation;
  for (int next = 0; next < count; next += kAtOnce) {
    const int i = std::min(next, count - kAtOnce);  // the last ones overlap those before
    correlate(first + i, stride, correlation.data());
    for (int k = 0; k < kAtOnce; ++k) {
      const auto at = static_cast<std::size_t>(i + k);
      const int sum = box.sum[at] - patch_sum;
      cost[at] = box.squares[at] - 2 * correlation[static_cast<std::size_t>(k)] + patch_squares -
                 sum * sum / Patch::kArea;
    }
  }
}

}  // namespace twofold
