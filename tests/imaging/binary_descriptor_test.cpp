#include "imaging/binary_descriptor.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <cstdint>
#include <numbers>
#include <opencv2/core.hpp>
#include <random>
#include <utility>

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

/// As find_nearest says it.
NearestDescriptor nearest_of(const BinaryDescriptor& descriptor, const std::vector<DescribedCorner>& others) {
  NearestDescriptor nearest;
  for (std::size_t j = 0; j < others.size(); ++j)
    nearest.offer(static_cast<int>(j), hamming_distance(descriptor, others[j].descriptor));
  return nearest;
}

// Of few bits that differ, so that there are many equals; of numbers that no block of four or of 256 divides.
TEST(BinaryDescriptor, TheNearestIsTheFirstOfEqualsOnBothSides) {
  std::mt19937 random(5);
  for (const auto& [of_a, of_b] : {std::pair{3, 1}, {0, 5}, {7, 0}, {310, 523}, {64, 256}}) {
    std::vector<DescribedCorner> a(static_cast<std::size_t>(of_a)), b(static_cast<std::size_t>(of_b));
    for (auto* side : {&a, &b}) {
      for (DescribedCorner& corner : *side) corner.descriptor.bits = {random() % 16, 0, random() % 4, ~0ULL};
    }
    if (of_b > 2) b.back().descriptor.bits = {~0ULL, ~0ULL, ~0ULL, 0};  // the largest distance, 256
    std::vector<NearestDescriptor> nearest_a(9), nearest_b;
    find_nearest(a, b, nearest_a, nearest_b);
    ASSERT_EQ(nearest_a.size(), a.size());
    ASSERT_EQ(nearest_b.size(), b.size());
    const auto expect_all = [](const auto& found, const auto& side, const auto& others) {
      for (std::size_t i = 0; i < side.size(); ++i) {
        const NearestDescriptor expected = nearest_of(side[i].descriptor, others);
        EXPECT_EQ(found[i].best, expected.best) << i;
        EXPECT_EQ(found[i].distance, expected.distance) << i;
      }
    };
    expect_all(nearest_a, a, b);
    expect_all(nearest_b, b, a);
  }
}

// The direction is that of the disc's centroid: its pixels count, and no others.
TEST(BinaryDescriptor, ItsDirectionIsThatOfTheDiscsCentroid) {
  cv::Mat image = blocks();
  ImagePyramid pyramid;
  pyramid.build(image);
  constexpr int u = 47, v = 50, radius = 15;
  double m10 = 0, m01 = 0;
  for (int dv = -radius; dv <= radius; ++dv) {
    for (int du = -radius; du <= radius; ++du) {
      if (du * du + dv * dv > radius * radius) continue;
      m10 += du * image.at<std::uint8_t>(v + dv, u + du);
      m01 += dv * image.at<std::uint8_t>(v + dv, u + du);
    }
  }
  std::vector<DescribedCorner> corners(1);
  corners[0].uv = {u, v};
  CornerDescriber().describe(pyramid, corners);
  const double expected = std::atan2(m01, m10);
  EXPECT_NEAR(std::remainder(corners.at(0).angle - expected, 2 * std::numbers::pi), 0, 1e-6);
  for (const int bright : {0, 255}) {  // a half is white: the largest moments there are
    image.setTo(255 - bright);
    image.rowRange(v, image.rows).setTo(bright);
    pyramid.build(image);
    corners[0].uv = {u, v};
    CornerDescriber().describe(pyramid, corners);
    const double turn = bright > 0 ? std::numbers::pi / 2 : -std::numbers::pi / 2;
    EXPECT_NEAR(std::remainder(corners.at(0).angle - turn, 2 * std::numbers::pi), 0, 0.05);
  }
}

}  // namespace
}  // namespace twofold
