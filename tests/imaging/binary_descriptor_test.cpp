#include "imaging/binary_descriptor.hpp"

#include <gtest/gtest.h>

#include <cstdint>
#include <opencv2/core.hpp>

namespace twofold {
namespace {

/// Blocks of four pixels, each of a grey of its own.
cv::Mat blocks() {
  cv::Mat image(96, 96, CV_8UC1);
  for (int v = 0; v < image.rows; ++v) {
    for (int u = 0; u < image.cols; ++u) {
      const std::uint32_t block = static_cast<std::uint32_t>(v / 4 * 31 + u / 4) * 2654435761U;
      image.at<std::uint8_t>(v, u) = static_cast<std::uint8_t>(block >> 24U);
    }
  }
  return image;
}

// Maps and vocabularies hold descriptors: a program must read those of every other one, whatever compiler and
// processor it was built with and for. A bit may differ where two pixels are nearly alike.
TEST(BinaryDescriptor, IsThatOfEveryOtherBuild) {
  ImagePyramid pyramid;
  pyramid.build(blocks());
  std::vector<DescribedCorner> corners(1);
  corners[0].uv = {47, 50};
  CornerDescriber().describe(pyramid, corners);
  ASSERT_EQ(corners.size(), 1U);
  const BinaryDescriptor expected{
      {0x69c57e21244fd6c1, 0x41b1051797d448bd, 0x3f1a45746148d6e8, 0x6262101ed31b8fdc}};
  EXPECT_LE(hamming_distance(corners[0].descriptor, expected), 8)
      << std::hex << corners[0].descriptor.bits[0] << ' ' << corners[0].descriptor.bits[1] << ' '
      << corners[0].descriptor.bits[2] << ' ' << corners[0].descriptor.bits[3];
}

}  // namespace
}  // namespace twofold
