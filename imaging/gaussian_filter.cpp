#include "imaging/gaussian_filter.hpp"

#include <array>
#include <cstdint>

namespace twofold {
namespace {

constexpr std::array<std::uint32_t, GaussianFilter::kBorder + 1> kWeights{56, 48, 34, 18};  // 256ths
static_assert(kWeights[0] + 2 * (kWeights[1] + kWeights[2] + kWeights[3]) == 256);

constexpr int kRing = 8;  // rows kept: those under the filter, and one

/// The row's pixels and their neighbours in it, weighted.
void smooth_along(const std::uint8_t* in, int columns, std::uint16_t* out) {
  constexpr int kBorder = GaussianFilter::kBorder;
  for (int u = kBorder; u < columns - kBorder; ++u) {
    std::uint32_t sum = kWeights[0] * in[u];
    for (int d = 1; d <= kBorder; ++d)
      sum += kWeights[static_cast<std::size_t>(d)] * (std::uint32_t{in[u - d]} + in[u + d]);
    out[u] = static_cast<std::uint16_t>(sum);
  }
}

/// Seven rows, weighted; the middle one's place in the image is that of the result.
void smooth_across(const std::array<const std::uint16_t*, 2 * GaussianFilter::kBorder + 1>& rows, int columns,
                   std::uint8_t* out) {
  constexpr int kBorder = GaussianFilter::kBorder;
  const auto [r0, r1, r2, r3, r4, r5, r6] = rows;
  for (int u = kBorder; u < columns - kBorder; ++u) {
    const std::uint32_t sum = kWeights[0] * r3[u] + kWeights[1] * (std::uint32_t{r2[u]} + r4[u]) +
                              kWeights[2] * (std::uint32_t{r1[u]} + r5[u]) +
                              kWeights[3] * (std::uint32_t{r0[u]} + r6[u]);
    out[u] = static_cast<std::uint8_t>((sum + (1U << 15)) >> 16);
  }
}

}  // namespace

void GaussianFilter::apply(const cv::Mat& image, cv::Mat& smooth) {
  smooth.create(image.rows, image.cols, CV_8UC1);
  const auto columns = static_cast<std::size_t>(image.cols);
  rows_.resize(kRing * columns);
  const auto row = [&](int v) { return rows_.data() + static_cast<std::size_t>(v % kRing) * columns; };
  for (int v = 0; v < image.rows; ++v) {
    smooth_along(image.ptr<std::uint8_t>(v), image.cols, row(v));
    const int centre = v - kBorder;
    if (centre < kBorder) continue;
    std::array<const std::uint16_t*, 2 * kBorder + 1> under;
    for (int k = 0; k <= 2 * kBorder; ++k) under[static_cast<std::size_t>(k)] = row(v - 2 * kBorder + k);
    smooth_across(under, image.cols, smooth.ptr<std::uint8_t>(centre));
  }
}

}  // namespace twofold
