#include "imaging/gaussian_filter.hpp"

#include <array>
#include <cstdint>

namespace twofold {
namespace {

constexpr std::array<std::uint32_t, GaussianFilter::kBorder + 1> kWeights{56, 48, 34, 18};  // 256ths
static_assert(kWeights[0] + 2 * (kWeights[1] + kWeights[2] + kWeights[3]) == 256);

/// Weighted sum of the pixel and its neighbours, `stride` pixels apart.
template <class Pixel>
std::uint32_t weighted(const Pixel* p, std::ptrdiff_t stride) {
  std::uint32_t sum = kWeights[0] * p[0];
  for (std::ptrdiff_t d = 1; d <= GaussianFilter::kBorder; ++d) {
    sum += kWeights[static_cast<std::size_t>(d)] * (std::uint32_t{p[d * stride]} + p[-d * stride]);
  }
  return sum;
}

}  // namespace

void GaussianFilter::apply(const cv::Mat& image, cv::Mat& smooth) {
  smooth.create(image.rows, image.cols, CV_8UC1);
  rows_.resize(image.total());
  const std::ptrdiff_t stride = image.cols;
  for (int v = 0; v < image.rows; ++v) {
    const auto* in = image.ptr<std::uint8_t>(v);
    std::uint16_t* out = rows_.data() + v * stride;
    for (int u = kBorder; u < image.cols - kBorder; ++u) {
      out[u] = static_cast<std::uint16_t>(weighted(in + u, 1));
    }
  }
  for (int v = kBorder; v < image.rows - kBorder; ++v) {
    const std::uint16_t* in = rows_.data() + v * stride;
    auto* out = smooth.ptr<std::uint8_t>(v);
    for (int u = kBorder; u < image.cols - kBorder; ++u) {
      out[u] = static_cast<std::uint8_t>((weighted(in + u, stride) + (1U << 15)) >> 16);
    }
  }
}

}  // namespace twofold
