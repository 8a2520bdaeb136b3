#pragma once

#include <array>
#include <bit>
#include <cstdint>
#include <span>
#include <vector>

#include "imaging/described_corner.hpp"
#include "imaging/gaussian_filter.hpp"
#include "imaging/image_pyramid.hpp"

namespace twofold {

/// Number of bits that differ, in [0, 256].
[[nodiscard]] inline int hamming_distance(const BinaryDescriptor& a, const BinaryDescriptor& b) {
  int distance = 0;
  for (std::size_t i = 0; i < a.bits.size(); ++i) distance += std::popcount(a.bits[i] ^ b.bits[i]);
  return distance;
}

/// The candidate whose descriptor is nearest, the first among equals.
struct NearestDescriptor {
  int best = -1;
  int distance = 257;
  void offer(int candidate, int d) {
    if (d >= distance) return;
    distance = d;
    best = candidate;
  }
};

/// The nearest of `b` to each of `a`, and of `a` to each of `b`: all pairs are compared.
void find_nearest(std::span<const DescribedCorner> a, std::span<const DescribedCorner> b,
                  std::vector<NearestDescriptor>& of_a, std::vector<NearestDescriptor>& of_b);

/// Pixels a corner must stay away from the border of its level to be described.
inline constexpr int kDescriptorBorder = 20;

/// Whether the corner is far enough from the border of its level.
[[nodiscard]] bool can_be_described(const ImagePyramid& pyramid, const DescribedCorner& corner);

/// Rotated binary comparisons on a smoothed image, steered by the intensity centroid of a disc of radius 15,
/// as ORB does (Rublee et al., ICCV 2011); the comparison pattern is this project's own, drawn once from a
/// fixed seed.
///
/// Keeps buffers between calls; one instance a thread.
class CornerDescriber {
 public:
  CornerDescriber();

  /// Makes room for images of this size: describing them allocates nothing from then on.
  void prepare(const ImagePyramid& pyramid);

  /// Fills angle and descriptor of each corner from its level of the pyramid. Corners nearer than
  /// kDescriptorBorder to the border of their level are removed.
  void describe(const ImagePyramid& pyramid, std::vector<DescribedCorner>& corners);

 private:
  static constexpr int kDirections = 32;
  /// Two pixels of the square around a corner that all comparisons are made in, which is copied out of the
  /// image: by their places in it.
  struct Comparison {
    std::uint16_t first, second;
  };

  void describe_one(const cv::Mat& image, const cv::Mat& smooth, DescribedCorner& corner) const;

  std::array<std::array<Comparison, 256>, kDirections>
      patterns_;  ///< the pattern turned in steps of 360/32 degrees
  GaussianFilter filter_;
  std::array<cv::Mat, ImagePyramid::kLevels> smooth_;
};

}  // namespace twofold
