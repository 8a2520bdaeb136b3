#include "io/files/image_pairs.hpp"

#include <gtest/gtest.h>

namespace twofold {
namespace {

using Files = std::vector<std::filesystem::path>;

TEST(ImagePairs, AreOfTheSameName) {
  const Files left{"l/a.png", "l/b.png", "l/d.png"}, right{"r/a.jpg", "r/c.jpg", "r/d.jpg"};
  EXPECT_EQ(pairs_by_name(left, right), (ImagePairs{{0, 0}, {2, 2}}));
}

TEST(ImagePairs, OrOfTheSameNumber) {
  const ImagePairs second_lacks_one{{0, 0}, {2, 1}};
  EXPECT_EQ(pairs_by_name({"left_007.png", "left_008.png", "left_009.png"}, {"right_7.png", "right_9.png"}),
            second_lacks_one);
  EXPECT_EQ(pairs_by_name({"frame-000000.color.png", "frame-000001.color.png", "frame-000002.color.png"},
                          {"frame-000000.depth.png", "frame-000002.depth.png"}),
            second_lacks_one);
  EXPECT_EQ(pairs_by_name({"cam0_1.png", "cam0_2.png", "cam0_3.png"}, {"cam1_1.png", "cam1_3.png"}),
            second_lacks_one)
      << "the camera's number counts no images";
}

TEST(ImagePairs, AreNotMadeByChance) {
  const Files stamps{"0.1.png", "0.2.png", "0.3.png", "0.4.png", "0.5.png"};
  EXPECT_TRUE(pairs_by_name(stamps, {"0.12.png", "0.22.png", "0.3.png", "0.42.png", "0.52.png"}).empty());
  EXPECT_TRUE(pairs_by_name({"a.png", "b.png"}, {"c.png", "d.png"}).empty());
  EXPECT_TRUE(pairs_by_name({"1.png", "01.png"}, {"r1.png", "r2.png"}).empty()) << "1 and 01 are the same";
}

std::vector<StampedFile> at(const std::vector<std::int64_t>& t_ns) {
  std::vector<StampedFile> files;
  for (const std::int64_t t : t_ns) files.push_back({t, {}});
  return files;
}

TEST(ImagePairs, AreNearestInTimeAndUsedOnce) {
  EXPECT_EQ(pairs_by_time(at({0, 100, 200, 300}), at({4, 90, 104, 390}), 10), (ImagePairs{{0, 0}, {1, 2}}));
  EXPECT_EQ(pairs_by_time(at({0, 6}), at({5}), 10), (ImagePairs{{1, 0}})) << "whoever is nearer";
  EXPECT_EQ(pairs_by_time(at({0, 10}), at({5}), 10), (ImagePairs{{0, 0}})) << "of two as near the earlier";
  EXPECT_EQ(pairs_by_time(at({5, 20}), at({0, 5, 10, 20}), 10), (ImagePairs{{0, 1}, {1, 3}}));
  EXPECT_TRUE(pairs_by_time(at({}), at({5}), 10).empty());
  EXPECT_TRUE(pairs_by_time(at({5}), at({}), 10).empty());
}

/// Depth is stamped 15 ms before colour, and 18 ms after the colour image before: within the tolerance, too.
TEST(ImagePairs, OneWithoutPartnerTakesNobodyElses) {
  constexpr std::int64_t kInterval = 33, kOffset = 15, kMaxGap = 20;
  std::vector<std::int64_t> colour, depth;
  ImagePairs expected;
  for (std::int64_t i = 0; i < 300; ++i) {
    colour.push_back(i * kInterval + kOffset);
    if (i == 20 || i == 150 || i == 151) continue;
    expected.emplace_back(i, depth.size());
    depth.push_back(i * kInterval);
  }
  EXPECT_EQ(pairs_by_time(at(colour), at(depth), kMaxGap), expected);
  ImagePairs swapped;
  for (const auto& [c, d] : expected) swapped.emplace_back(d, c);
  EXPECT_EQ(pairs_by_time(at(depth), at(colour), kMaxGap), swapped);
}

/// As when a long gap is allowed: every image is near several others.
TEST(ImagePairs, KeepTheOrderOfTime) {
  EXPECT_EQ(pairs_by_time(at({0, 50, 100}), at({55, 105, 155}), 200), (ImagePairs{{1, 0}, {2, 1}}))
      << "the first is not paired with the last";
}

}  // namespace
}  // namespace twofold
