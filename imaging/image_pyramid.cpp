#include "imaging/image_pyramid.hpp"

#if defined(__AVX2__)
#include <immintrin.h>
#elif defined(__aarch64__)
#include <arm_neon.h>
#endif

#include <algorithm>
#include <array>
#include <cstdint>
#include <opencv2/core.hpp>

namespace twofold {

namespace {

/// Mean of each 2x2 block, rounded. An odd last row or column has no partner and is left out. By hand,
/// because OpenCV's version wakes its thread pool, whatever the size.
void halve(const cv::Mat& image, cv::Mat& half) {
  half.create(image.rows / 2, image.cols / 2, CV_8UC1);
  for (int v = 0; v < half.rows; ++v) {
    const std::uint8_t* upper = image.ptr<std::uint8_t>(2 * v);
    const std::uint8_t* lower = image.ptr<std::uint8_t>(2 * v + 1);
    std::uint8_t* out = half.ptr<std::uint8_t>(v);
    int u = 0;
#if defined(__AVX2__)
    const __m256i ones = _mm256_set1_epi8(1);
    const auto block_sums = [&](int at) {
      const auto pairs = [&](const std::uint8_t* row) {
        return _mm256_maddubs_epi16(_mm256_loadu_si256(reinterpret_cast<const __m256i*>(row + at)), ones);
      };
      const __m256i sums = _mm256_add_epi16(pairs(upper), pairs(lower));
      return _mm256_srli_epi16(_mm256_add_epi16(sums, _mm256_set1_epi16(2)), 2);
    };
    for (; u + 32 <= half.cols; u += 32) {
      // Packing works within halves of a register; the permutation puts the quarters in order again.
      const __m256i packed = _mm256_packus_epi16(block_sums(2 * u), block_sums(2 * u + 32));
      _mm256_storeu_si256(reinterpret_cast<__m256i*>(out + u), _mm256_permute4x64_epi64(packed, 0xd8));
    }
#elif defined(__aarch64__)
    for (; u + 8 <= half.cols; u += 8) {
      const uint16x8_t sums = vpadalq_u8(vpaddlq_u8(vld1q_u8(upper + 2 * u)), vld1q_u8(lower + 2 * u));
      vst1_u8(out + u, vrshrn_n_u16(sums, 2));
    }
#endif
    for (; u < half.cols; ++u) {
      const int sum = upper[2 * u] + upper[2 * u + 1] + lower[2 * u] + lower[2 * u + 1];
      out[u] = static_cast<std::uint8_t>((sum + 2) / 4);
    }
  }
}

/// Mean of the middle two of its four neighbours, of which one may be on the other side of an edge, or dead.
std::uint8_t from_neighbours(const cv::Mat& image, const cv::Point& at) {
  const std::uint8_t* p = image.ptr<std::uint8_t>(at.y) + at.x;
  const auto stride = static_cast<std::ptrdiff_t>(image.step);
  std::array<int, 4> around{p[-1], p[1], p[-stride], p[stride]};
  std::sort(around.begin(), around.end());
  return static_cast<std::uint8_t>((around[1] + around[2]) / 2);
}

}  // namespace

void ImagePyramid::build(const cv::Mat& image, std::span<const cv::Point> dead) {
  image.copyTo(levels_[0]);
  for (const cv::Point& at : dead) levels_[0].at<std::uint8_t>(at) = from_neighbours(levels_[0], at);
  for (std::size_t l = 1; l < kLevels; ++l) halve(levels_[l - 1], levels_[l]);
}

void ImagePyramid::copy_from(const ImagePyramid& other) {
  for (std::size_t l = 0; l < kLevels; ++l) {
    if (other.levels_[l].empty()) {
      levels_[l].release();
    } else {
      other.levels_[l].copyTo(levels_[l]);
    }
  }
}

void FrameImages::copy_from(const FrameImages& other) {
  left.copy_from(other.left);
  right.copy_from(other.right);
  if (other.depth.empty()) {
    depth.release();
  } else {
    other.depth.copyTo(depth);
  }
}

double mean_brightness(const ImagePyramid& pyramid) {
  return cv::mean(pyramid.level(ImagePyramid::kLevels - 1))[0];
}

}  // namespace twofold
