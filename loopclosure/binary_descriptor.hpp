#pragma once

#include <array>
#include <bit>
#include <cstdint>
#include <span>
#include <vector>

#include "graph/place_appearance.hpp"
#include "imaging/image_pyramid.hpp"

namespace twofold {

/// Number of bits that differ, in [0, 256].
[[nodiscard]] inline int hamming_distance(const BinaryDescriptor& a, const BinaryDescriptor& b) {
  int distance = 0;
  for (std::size_t i = 0; i < a.bits.size(); ++i) distance += std::popcount(a.bits[i] ^ b.bits[i]);
  return distance;
}

/// Pixels a corner must stay away from the border of its level to be described.
inline constexpr int kDescriptorBorder = 20;

/// Rotated binary comparisons on a smoothed image, steered by the intensity centroid of a disc of radius 15,
/// as ORB does (Rublee et al., ICCV 2011); the comparison pattern is this project's own, drawn once from a
/// fixed seed.
///
/// Keeps buffers between calls; one instance a thread.
class CornerDescriber {
 public:
  CornerDescriber();

  /// Fills angle and descriptor of each corner from its level of the pyramid. Corners nearer than
  /// kDescriptorBorder to the border of their level are removed.
  void describe(const ImagePyramid& pyramid, std::vector<DescribedCorner>& corners);

 private:
  static constexpr int kDirections = 32;
  struct Comparison {
    std::int8_t u0, v0, u1, v1;
  };

  void describe_one(const cv::Mat& image, const cv::Mat& smooth, DescribedCorner& corner) const;

  std::array<std::array<Comparison, 256>, kDirections>
      patterns_;  ///< the pattern turned in steps of 360/32 degrees
  std::array<cv::Mat, ImagePyramid::kLevels> smooth_;
};

}  // namespace twofold
