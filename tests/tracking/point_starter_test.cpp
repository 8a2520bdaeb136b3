#include "tracking/search/point_starter.hpp"

#include <gtest/gtest.h>

#include <opencv2/core.hpp>
#include <set>
#include <utility>

#include "camera/rolling_shutter.hpp"
#include "fixtures/rendered_scene.hpp"
#include "geometry/inverse_depth.hpp"

namespace twofold {
namespace {

constexpr KeyframeId kAnchor{5};

/// A stereo pair of a textured room, and what a starter makes of it.
class PointStarterTest : public ::testing::Test {
 protected:
  PointStarterTest() : rig_(testing::test_rig(SensorKind::kStereo, 320, 240)) {
    testing::RenderedScene scene(rig_, {3, 2, 5}, 21);
    scene.render(SE3(), 2, images_);
    options_.max_points = 60;
  }

  ImmaturePoints started(PointStarter& starter) {
    ImmaturePoints points(200, 1);
    const int count = starter.start(images_, kAnchor, RollingShutter(), points);
    EXPECT_EQ(count, static_cast<int>(points.points().size()));
    return points;
  }
  [[nodiscard]] std::pair<int, int> cell_of(const Eigen::Vector2f& uv) const {
    return {static_cast<int>(uv.x()) / options_.cell_px, static_cast<int>(uv.y()) / options_.cell_px};
  }

  Rig rig_;
  NewPointOptions options_;
  GuidedSearchOptions search_;
  FrameImages images_;
};

TEST_F(PointStarterTest, StartsOnePointACellWithTheDepthOfThePair) {
  PointStarter starter(rig_, options_, search_);
  const ImmaturePoints points = started(starter);
  EXPECT_GT(points.points().size(), 30U);
  EXPECT_LE(points.points().size(), 60U);
  std::set<std::pair<int, int>> cells;
  for (const ImmaturePoint& point : points.points()) {
    EXPECT_EQ(point.anchor, kAnchor);
    EXPECT_TRUE(cells.insert(cell_of(point.appearance.uv)).second);
    const Vector3 z = rig_.project(from_inverse_depth(point.psi));
    EXPECT_NEAR(z.x(), point.appearance.uv.x(), 0.01);
    EXPECT_NEAR(z.y(), point.appearance.uv.y(), 0.01);
    EXPECT_NEAR(z.z(), point.anchor_observation.pixel.z(), 0.01);
  }
}

TEST_F(PointStarterTest, TakesTheWidestImage) {
  Rig wide = rig_;
  wide.camera.width = 16384;
  wide.camera.height = 64;
  FrameImages images;
  cv::Mat noise(64, 16384, CV_8UC1);
  cv::randu(noise, 0, 255);
  images.left.build(noise);
  PointStarter starter(wide, options_, search_);
  EXPECT_TRUE(starter.sees_corners(images.left, 100));
}

/// Of a cell's corners the best one has no depth, and others have.
TEST_F(PointStarterTest, LooksCloserWhereMostCornersHaveNoDepth) {
  const Rig rig = testing::test_rig(SensorKind::kRgbd, 320, 240);
  testing::RenderedScene(rig, {3, 2, 5}, 21).render(SE3(), 2, images_);
  for (int u = 0; u < images_.depth.cols; ++u) {
    if (u / 10 % 3 != 0) images_.depth.col(u).setTo(0);
  }
  options_.max_points = 220;
  options_.crowded_below = 0;
  PointStarter usual(rig, options_, search_);
  const std::size_t as_usual = started(usual).points().size();
  options_.crowded_below = 90;
  PointStarter closer(rig, options_, search_);
  const ImmaturePoints points = started(closer);
  EXPECT_LT(as_usual, 60U);
  EXPECT_GT(points.points().size(), 3 * as_usual / 2);
  EXPECT_LE(points.points().size(), 90U);
  for (const ImmaturePoint& point : points.points())
    EXPECT_NEAR(rig.project(from_inverse_depth(point.psi)).z(), point.anchor_observation.pixel.z(), 0.01);
}

TEST_F(PointStarterTest, StartsNothingWhereAPointIsTracked) {
  PointStarter starter(rig_, options_, search_);
  const ImmaturePoints before = started(starter);
  starter.clear();
  std::set<std::pair<int, int>> tracked;
  for (const ImmaturePoint& point : before.points()) {
    starter.occupy(point.appearance.uv);
    tracked.insert(cell_of(point.appearance.uv));
  }
  const ImmaturePoints after = started(starter);
  for (const ImmaturePoint& point : after.points())
    EXPECT_FALSE(tracked.contains(cell_of(point.appearance.uv)));
}

TEST_F(PointStarterTest, ClearsWhatWasTracked) {
  PointStarter starter(rig_, options_, search_);
  const std::size_t all = started(starter).points().size();
  starter.clear();
  EXPECT_EQ(started(starter).points().size(), all);
}

TEST_F(PointStarterTest, EndsWhenThereIsNoRoom) {
  PointStarter starter(rig_, options_, search_);
  ImmaturePoints points(7, 1);
  EXPECT_EQ(starter.start(images_, kAnchor, RollingShutter(), points), 7);
}

TEST_F(PointStarterTest, ChoosesCornersUpToTheRoomThereIs) {
  PointStarter starter(rig_, options_, search_);
  std::vector<PointAppearance> appearances;
  appearances.reserve(20);
  starter.choose_corners(images_, 100, appearances);
  EXPECT_EQ(appearances.size(), 20U);
  std::set<std::pair<int, int>> cells;
  for (const PointAppearance& appearance : appearances)
    EXPECT_TRUE(cells.insert(cell_of(appearance.uv)).second);
}

TEST_F(PointStarterTest, SeesCornersOnlyWhereThereAreSome) {
  PointStarter starter(rig_, options_, search_);
  EXPECT_TRUE(starter.sees_corners(images_.left, 20));
  FrameImages grey;
  grey.left.build(cv::Mat(240, 320, CV_8UC1, cv::Scalar(120)));
  EXPECT_FALSE(starter.sees_corners(grey.left, 1));
}

TEST_F(PointStarterTest, SaysThatThePairIsSwapped) {
  PointStarter starter(rig_, options_, search_);
  FrameImages swapped;
  swapped.left.build(images_.right.level(0));
  swapped.right.build(images_.left.level(0));
  EXPECT_EQ(starter.explain_missing_depth(swapped, 20), LostCause::kImagesSwapped);
  EXPECT_NE(starter.explain_missing_depth(images_, 20), LostCause::kImagesSwapped);
}

}  // namespace
}  // namespace twofold
