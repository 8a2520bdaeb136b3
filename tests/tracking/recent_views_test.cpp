#include "tracking/loss/recent_views.hpp"

#include <gtest/gtest.h>

namespace twofold {
namespace {

FrameImages grey(int level) {
  FrameImages images;
  images.left.build(cv::Mat(48, 64, CV_8UC1, cv::Scalar(level)));
  return images;
}

TEST(RecentViews, HoldTheNewestFromTheNewestOn) {
  RecentViews views(3, {kNoKeyframe, grey(0), {}});
  EXPECT_EQ(views.size(), 0U);
  for (int n = 1; n <= 5; ++n) {
    views.add(KeyframeId{static_cast<std::uint32_t>(n)}, grey(10 * n));
    ASSERT_EQ(views.size(), static_cast<std::size_t>(std::min(n, 3)));
    for (std::size_t age = 0; age < views.size(); ++age) {
      const int expected = n - static_cast<int>(age);
      EXPECT_EQ(views[age].id, KeyframeId{static_cast<std::uint32_t>(expected)});
      EXPECT_EQ(views[age].images.left.level(0).at<std::uint8_t>(20, 30), 10 * expected);
    }
  }
}

TEST(RecentViews, AViewKeepsItsImagesAndLosesTheCornersOfTheOneBefore) {
  RecentViews views(1, {kNoKeyframe, grey(0), {}});
  const FrameImages seen = grey(70);
  views.add(KeyframeId{1}, seen);
  EXPECT_NE(views[0].images.left.level(0).data, seen.left.level(0).data)
      << "the frame's images are written again";
  views[0].corners.corners.emplace_back();
  views[0].corners.described = true;
  views.add(KeyframeId{2}, seen);
  EXPECT_TRUE(views[0].corners.corners.empty());
  EXPECT_FALSE(views[0].corners.described);
}

}  // namespace
}  // namespace twofold
