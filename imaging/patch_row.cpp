#ifdef __AVX2__
#include <immintrin.h>
#endif

#include <array>
#include <cstring>

#include "geometry/check.hpp"
#include "imaging/patch.hpp"

namespace twofold {
namespace {

constexpr int kSize = Patch::kSize;
constexpr int kMaxColumns = kMaxRowCosts + kSize - 1;

/// Sums and sums of squares of the image under the patch at every position: by columns, then over eight of
/// them.
struct BoxSums {
  std::array<int, kMaxColumns> sum{};
  std::array<int, kMaxColumns> squares{};

  BoxSums(const std::uint8_t* first, std::ptrdiff_t stride, int columns) {
    for (int r = 0; r < kSize; ++r, first += stride) {
      for (int x = 0; x < columns; ++x) {
        const int pixel = first[x];
        sum[static_cast<std::size_t>(x)] += pixel;
        squares[static_cast<std::size_t>(x)] += pixel * pixel;
      }
    }
    for (int apart = 1; apart < kSize; apart *= 2) {
      columns -= apart;
      for (int x = 0; x < columns; ++x) {
        sum[static_cast<std::size_t>(x)] += sum[static_cast<std::size_t>(x + apart)];
        squares[static_cast<std::size_t>(x)] += squares[static_cast<std::size_t>(x + apart)];
      }
    }
  }
};

/// Correlation of the patch with the image at eight neighbouring positions; `first` is the pixel under the
/// patch's first entry at the first of them.
#ifdef __AVX2__
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

// Sum (q - t)^2 = sum q^2 - 2 sum q t + sum t^2: the first is shared by neighbours, the last by all.
void zero_mean_ssd_row(const Patch& patch, const cv::Mat& image, int u, int v, std::span<int> cost) {
  constexpr int kTogether = 8;
  const auto count = static_cast<int>(cost.size());
  TWOFOLD_CHECK(count <= kMaxRowCosts, "a longer stretch of a row than there is room for");
  if (count < kTogether) {
    for (int i = 0; i < count; ++i) cost[static_cast<std::size_t>(i)] = zero_mean_ssd(patch, image, u + i, v);
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
  std::array<int, kTogether> correlation;
  for (int next = 0; next < count; next += kTogether) {
    const int i = std::min(next, count - kTogether);  // the last ones overlap those before
    correlate(first + i, stride, correlation.data());
    for (int k = 0; k < kTogether; ++k) {
      const auto at = static_cast<std::size_t>(i + k);
      const int sum = box.sum[at] - patch_sum;
      cost[at] = box.squares[at] - 2 * correlation[static_cast<std::size_t>(k)] + patch_squares -
                 sum * sum / Patch::kArea;
    }
  }
}

}  // namespace twofold
