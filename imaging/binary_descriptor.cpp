#include "imaging/binary_descriptor.hpp"

#if defined(__AVX2__)
#include <immintrin.h>
#endif

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <cstring>
#include <numbers>
#include <random>

#include "base/gaussian.hpp"
#include "imaging/level_pixels.hpp"

namespace twofold {
namespace {

constexpr int kDiscRadius = 15;
constexpr double kPatternSigma = 6.0;
constexpr double kPatternRadius = 13.0;
constexpr std::uint32_t kPatternSeed = 20120501;

Vector2 draw_in_disc(std::mt19937& rng) {
  for (;;) {
    // One after the other: compilers evaluate the arguments of a call in any order.
    Vector2 p;
    p.y() = kPatternSigma * gaussian(rng);
    p.x() = kPatternSigma * gaussian(rng);
    if (p.norm() <= kPatternRadius) return p;
  }
}

// Of the square that the comparisons are made in: rows are as long as a register.
constexpr int kSquareRadius = static_cast<int>(kPatternRadius);
constexpr int kSquareRows = 2 * kSquareRadius + 1;
constexpr int kSquareColumns = 32;

std::uint16_t place_in_square(const Vector2& p) {
  const auto u = static_cast<int>(std::lround(p.x())), v = static_cast<int>(std::lround(p.y()));
  return static_cast<std::uint16_t>((v + kSquareRadius) * kSquareColumns + u + kSquareRadius);
}

constexpr std::size_t kDiscColumns = 32;  // the disc's and one that is no part of it
using DiscRow = std::uint8_t __attribute__((vector_size(kDiscColumns)));
using DiscSums = std::int16_t __attribute__((vector_size(2 * kDiscColumns)));

/// Of each row of the disc, 255 where it has a pixel.
struct Disc {
  alignas(32) std::array<std::array<std::uint8_t, kDiscColumns>, 2 * kDiscRadius + 1> rows{};

  constexpr Disc() {
    for (int dv = -kDiscRadius; dv <= kDiscRadius; ++dv) {
      for (int du = -kDiscRadius; du <= kDiscRadius; ++du) {
        if (du * du + dv * dv <= kDiscRadius * kDiscRadius)
          rows[static_cast<std::size_t>(dv + kDiscRadius)][static_cast<std::size_t>(du + kDiscRadius)] = 255;
      }
    }
  }
};
constexpr Disc kDisc;

/// Sums over the columns first: neither those of 31 pixels nor those of their moments leave 16 bits.
float centroid_angle(const cv::Mat& image, int u, int v) {
  DiscSums grey{}, moment{};  // of the columns
  for (int dv = -kDiscRadius; dv <= kDiscRadius; ++dv) {
    DiscRow row, mask;
    std::memcpy(&row, image.ptr<std::uint8_t>(v + dv) + u - kDiscRadius, sizeof row);
    std::memcpy(&mask, kDisc.rows[static_cast<std::size_t>(dv + kDiscRadius)].data(), sizeof mask);
    const DiscSums pixels = __builtin_convertvector(row & mask, DiscSums);
    grey += pixels;
    moment += pixels * static_cast<std::int16_t>(dv);
  }
  int m10 = 0;
  int m01 = 0;
  for (std::size_t c = 0; c < kDiscColumns; ++c) {
    m10 += (static_cast<int>(c) - kDiscRadius) * grey[c];
    m01 += moment[c];
  }
  const double angle = std::atan2(static_cast<double>(m01), static_cast<double>(m10));
  return static_cast<float>(angle < 0 ? angle + 2 * std::numbers::pi : angle);
}

}  // namespace

bool can_be_described(const ImagePyramid& pyramid, const DescribedCorner& corner) {
  const cv::Mat& image = pyramid.level(corner.level);
  const Eigen::Vector2f uv = to_level(corner.uv.x(), corner.uv.y(), corner.level);
  return uv.x() >= kDescriptorBorder && uv.y() >= kDescriptorBorder &&
         uv.x() <= image.cols - 1 - kDescriptorBorder && uv.y() <= image.rows - 1 - kDescriptorBorder;
}

namespace {

void compare_one_by_one(std::span<const DescribedCorner> a, std::span<const DescribedCorner> b,
                        std::size_t first_b, std::vector<NearestDescriptor>& of_a,
                        std::vector<NearestDescriptor>& of_b) {
  for (std::size_t i = 0; i < a.size(); ++i) {
    for (std::size_t j = first_b; j < b.size(); ++j) {
      const int d = hamming_distance(a[i].descriptor, b[j].descriptor);
      of_a[i].offer(static_cast<int>(j), d);
      of_b[j].offer(static_cast<int>(i), d);
    }
  }
}

#if defined(__AVX2__)

/// Some descriptors word by word, so that four are compared at once. A distance and whose it is make one
/// number, the distance in its upper bits: the least of such numbers is the nearest, and the first of equals.
class DescriptorBlock {
 public:
  static constexpr std::size_t kRoom = 256;
  static constexpr std::size_t kTogether = 4;

  explicit DescriptorBlock(std::span<const DescribedCorner> corners) : count_(corners.size()) {
    for (std::size_t j = 0; j < count_; ++j) {
      for (std::size_t k = 0; k < words_.size(); ++k) words_[k][j] = corners[j].descriptor.bits[k];
    }
    nearest_.fill(kNone);
  }

  /// Compares all with that of number i; its nearest one is returned, by its place in the block.
  [[nodiscard]] NearestDescriptor compare(const BinaryDescriptor& descriptor, std::size_t i) {
    const __m256i mine = _mm256_set1_epi64x(static_cast<std::int64_t>(i));
    const __m256i step = _mm256_set1_epi64x(kTogether);
    __m256i place = _mm256_setr_epi64x(0, 1, 2, 3);
    __m256i best = _mm256_set1_epi64x(kNone);
    for (std::size_t j = 0; j < count_; j += kTogether, place = _mm256_add_epi64(place, step)) {
      const __m256i distance = _mm256_slli_epi64(distances(descriptor, j), kNumberBits);
      best = _mm256_min_epu32(best, _mm256_or_si256(distance, place));
      auto* nearest = reinterpret_cast<__m256i*>(&nearest_[j]);
      const __m256i before = _mm256_load_si256(nearest);
      _mm256_store_si256(nearest, _mm256_min_epu32(before, _mm256_or_si256(distance, mine)));
    }
    alignas(32) std::array<std::int64_t, kTogether> lanes;
    _mm256_store_si256(reinterpret_cast<__m256i*>(lanes.data()), best);
    return unpacked(*std::min_element(lanes.begin(), lanes.end()));
  }
  /// Of those that were compared, the nearest to the block's j-th.
  [[nodiscard]] NearestDescriptor nearest(std::size_t j) const { return unpacked(nearest_[j]); }

 private:
  static constexpr int kNumberBits = 22;
  static constexpr std::int64_t kNone = std::int64_t{257} << kNumberBits;

  static NearestDescriptor unpacked(std::int64_t packed) {
    if (packed == kNone) return {};
    return {static_cast<int>(packed & ((1 << kNumberBits) - 1)), static_cast<int>(packed >> kNumberBits)};
  }

  /// Of the descriptors j to j + 3: bits are counted by halves of bytes, which a table has.
  [[nodiscard]] __m256i distances(const BinaryDescriptor& descriptor, std::size_t j) const {
    const __m256i table = _mm256_setr_epi8(0, 1, 1, 2, 1, 2, 2, 3, 1, 2, 2, 3, 2, 3, 3, 4,  //
                                           0, 1, 1, 2, 1, 2, 2, 3, 1, 2, 2, 3, 2, 3, 3, 4);
    const __m256i low_half = _mm256_set1_epi8(15);
    __m256i bytes = _mm256_setzero_si256();
    for (std::size_t k = 0; k < words_.size(); ++k) {
      const __m256i word = _mm256_load_si256(reinterpret_cast<const __m256i*>(&words_[k][j]));
      const auto bits = static_cast<std::int64_t>(descriptor.bits[k]);
      const __m256i differ = _mm256_xor_si256(word, _mm256_set1_epi64x(bits));
      const __m256i low = _mm256_and_si256(differ, low_half);
      const __m256i high = _mm256_and_si256(_mm256_srli_epi16(differ, 4), low_half);
      bytes = _mm256_add_epi8(bytes, _mm256_shuffle_epi8(table, low));
      bytes = _mm256_add_epi8(bytes, _mm256_shuffle_epi8(table, high));
    }
    return _mm256_sad_epu8(bytes, _mm256_setzero_si256());
  }

  std::size_t count_;
  alignas(32) std::array<std::array<std::uint64_t, kRoom>, 4> words_;
  alignas(32) std::array<std::int64_t, kRoom> nearest_;
};

#endif

}  // namespace

void find_nearest(std::span<const DescribedCorner> a, std::span<const DescribedCorner> b,
                  std::vector<NearestDescriptor>& of_a, std::vector<NearestDescriptor>& of_b) {
  of_a.assign(a.size(), {});
  of_b.assign(b.size(), {});
  std::size_t compared = 0;
#if defined(__AVX2__)
  const std::size_t fours = b.size() / DescriptorBlock::kTogether * DescriptorBlock::kTogether;
  for (std::size_t next = 0; next < fours; next = compared) {
    compared = std::min(next + DescriptorBlock::kRoom, fours);
    DescriptorBlock block(b.subspan(next, compared - next));
    for (std::size_t i = 0; i < a.size(); ++i) {
      const NearestDescriptor nearest = block.compare(a[i].descriptor, i);
      of_a[i].offer(static_cast<int>(next) + nearest.best, nearest.distance);
    }
    for (std::size_t j = next; j < compared; ++j) of_b[j] = block.nearest(j - next);
  }
#endif
  compare_one_by_one(a, b, compared, of_a, of_b);
}

CornerDescriber::CornerDescriber() {
  std::mt19937 rng(kPatternSeed);
  for (std::size_t i = 0; i < 256; ++i) {
    const Vector2 a = draw_in_disc(rng);
    const Vector2 b = draw_in_disc(rng);
    for (int d = 0; d < kDirections; ++d) {
      const double angle = 2 * std::numbers::pi * d / kDirections;
      const Eigen::Rotation2Dd R(angle);
      patterns_[static_cast<std::size_t>(d)][i] = {place_in_square(R * a), place_in_square(R * b)};
    }
  }
}

void CornerDescriber::prepare(const ImagePyramid& pyramid) {
  for (std::size_t l = 0; l < smooth_.size(); ++l) {
    filter_.apply(pyramid.level(static_cast<int>(l)), smooth_[l]);
  }
}

void CornerDescriber::describe(const ImagePyramid& pyramid, std::vector<DescribedCorner>& corners) {
  std::array<bool, ImagePyramid::kLevels> smoothed{};
  std::erase_if(corners, [&](DescribedCorner& corner) {
    if (!can_be_described(pyramid, corner)) return true;
    const std::size_t l = corner.level;
    const cv::Mat& image = pyramid.level(corner.level);
    if (!smoothed[l]) {
      filter_.apply(image, smooth_[l]);
      smoothed[l] = true;
    }
    describe_one(image, smooth_[l], corner);
    return false;
  });
}

void CornerDescriber::describe_one(const cv::Mat& image, const cv::Mat& smooth,
                                   DescribedCorner& corner) const {
  const Eigen::Vector2f uv = to_level(corner.uv.x(), corner.uv.y(), corner.level);
  const int u = static_cast<int>(std::lround(uv.x()));
  const int v = static_cast<int>(std::lround(uv.y()));
  corner.angle = centroid_angle(image, u, v);
  const double turn = corner.angle / (2 * std::numbers::pi) * kDirections;
  const auto& pattern = patterns_[static_cast<std::size_t>(std::lround(turn)) % kDirections];
  std::array<std::uint8_t, std::size_t{kSquareRows} * kSquareColumns> square;
  for (int row = 0; row < kSquareRows; ++row) {
    const std::uint8_t* pixels = smooth.ptr<std::uint8_t>(v + row - kSquareRadius) + u - kSquareRadius;
    std::memcpy(&square[static_cast<std::size_t>(row) * kSquareColumns], pixels, kSquareColumns);
  }
  for (std::size_t word = 0; word < 4; ++word) {
    std::uint64_t bits = 0;
    for (std::size_t b = 0; b < 64; ++b) {
      const Comparison& c = pattern[64 * word + b];
      bits |= std::uint64_t{square[c.first] < square[c.second]} << b;
    }
    corner.descriptor.bits[word] = bits;
  }
}

}  // namespace twofold
