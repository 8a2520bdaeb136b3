#include "tracking/monocular/depth_seeds.hpp"

#include <gtest/gtest.h>

#include <span>

#include "base/median.hpp"
#include "fixtures/rendered_scene.hpp"
#include "imaging/fast_corners.hpp"
#include "imaging/patch.hpp"

namespace twofold {
namespace {

constexpr KeyframeId kAnchor{3};
constexpr double kMedianDepth = 4;

/// Corners of an image, one a cell.
std::vector<PointAppearance> corners_of(const Rig& rig, const ImagePyramid& image) {
  std::vector<Corner> corners;
  corners.reserve(1000);
  const int columns = rig.camera.width / 32, rows = rig.camera.height / 32;
  const std::vector<std::uint8_t> free(static_cast<std::size_t>(columns * rows), 0);
  detect_corners(image.level(0), 0, 10, 15, 12, {32, columns, rows, free}, corners);
  std::vector<PointAppearance> appearances;
  PointAppearance appearance;
  for (const Corner& corner : corners) {
    if (cut_appearance(image.level(0), corner.u, corner.v, 0, appearance)) appearances.push_back(appearance);
  }
  return appearances;
}

/// Corners of a rendered room, seen from its middle; others of a room that is not there.
class DepthSeedsTest : public ::testing::Test {
 protected:
  /// @param room  whose corners are to be found
  void begin(const DepthSeedOptions& options, std::uint32_t room = 21) {
    seeds_.emplace(rig_, GuidedSearchOptions{}, options, 300);
    testing::RenderedScene scene(rig_, kRoom, room);
    FrameImages images;
    scene.render(SE3(), 1, images);
    for (const PointAppearance& appearance : corners_of(rig_, images.left))
      seeds_->add(kAnchor, appearance, {});
    ASSERT_GT(seeds_->size(), 30U);
  }
  /// The camera has moved by `shift` to the right.
  void look(double shift, double median_depth = kMedianDepth) {
    const SE3 T_c_a(SO3(), Vector3(-shift, 0, 0));
    FrameImages images;
    scene_.render(T_c_a, 1, images);
    seeds_->observe(
        images.left, {}, median_depth, [&](KeyframeId) { return T_c_a; }, ready_);
  }
  [[nodiscard]] std::size_t ready() const { return ready_.points().size(); }
  /// By how far two views' depths are apart that differ by a pixel, as inverse depths.
  [[nodiscard]] double shift_for(double inverse_depth_error) const {
    return rig_.noise.sigma_px / (rig_.camera.fx * inverse_depth_error);
  }

  const Rig rig_ = testing::test_rig(SensorKind::kMono, 320, 240);
  const Vector3 kRoom{3, 2, kMedianDepth};
  testing::RenderedScene scene_{rig_, kRoom, 21};
  std::optional<DepthSeeds> seeds_;
  ImmaturePoints ready_{300, 1};
};

TEST_F(DepthSeedsTest, APointIsUsedWhenItsDepthIsKnown) {
  DepthSeedOptions options;
  options.far_error = 0;
  begin(options);
  const std::size_t all = seeds_->size();
  look(shift_for(1.6 * options.near_error / kMedianDepth));  // few are as near as that
  EXPECT_LT(ready(), all / 4);
  const std::size_t early = ready();
  look(shift_for(0.4 * options.near_error / kMedianDepth));
  EXPECT_GT(ready(), early + all / 2);
  int wrong = 0;
  for (const ImmaturePoint& point : ready_.points()) {
    const double truth = 1 / scene_.depth(SE3(), point.appearance.uv.cast<double>());
    wrong += std::abs(point.psi.z() - truth) > 3 * options.near_error * truth ? 1 : 0;
  }
  EXPECT_LE(wrong, static_cast<int>(ready()) / 20);
  EXPECT_EQ(seeds_->size() + ready(), all) << "it is no seed any more";
}

/// What is far away is known to be far long before its distance is.
// A far point may need many keyframes until its depth is known, and joins the map with the next ones: its age
// counts from then.
TEST_F(DepthSeedsTest, APointIsUsableSinceItsDepthIsKnown) {
  begin({});
  constexpr KeyframeId kNewest{7};
  seeds_->begin_keyframe(kNewest);
  look(0.5);
  ASSERT_GT(ready(), 10U);
  for (const ImmaturePoint& point : ready_.points()) {
    EXPECT_EQ(point.anchor, kAnchor);
    EXPECT_EQ(point.usable_since, kNewest);
  }
  const std::size_t all = ready();
  ready_.drop_stale(KeyframeId{9}, 4, 3);
  EXPECT_EQ(ready(), all) << "usable for two keyframes";
  ready_.drop_stale(KeyframeId{11}, 4, 3);
  EXPECT_EQ(ready(), 0U);
}

TEST_F(DepthSeedsTest, AFarPointIsUsedWhenItIsKnownToBeFar) {
  constexpr double kNear = kMedianDepth / 10;  // most of the scene is there
  for (const double far_error : {0.0, 0.02}) {
    ready_.clear_points();
    DepthSeedOptions options;
    options.near_error = 0.05;
    options.far_error = far_error;
    begin(options);
    look(shift_for(0.4 * 0.02 / kNear), kNear);
    EXPECT_EQ(ready() > seeds_->size(), far_error > 0) << ready();
  }
}

TEST_F(DepthSeedsTest, APointIsUsedWhenEnoughFramesHaveSeenIt) {
  DepthSeedOptions options;
  options.min_looks = 2;
  begin(options);
  look(0.3);
  EXPECT_EQ(ready(), 0U);
  look(0.6);
  EXPECT_GT(ready(), seeds_->size());
}

/// What was seen from far aside is not known better by a look from beside where it was seen first.
TEST_F(DepthSeedsTest, ALookThatAddsLittleIsNoWitness) {
  DepthSeedOptions options;
  options.min_looks = 2;
  begin(options);
  look(0.6);
  for (int frame = 0; frame < 3; ++frame) look(0.1);
  EXPECT_LT(ready(), seeds_->size() / 4);
  look(0.9);
  EXPECT_GT(ready(), seeds_->size());
}

TEST_F(DepthSeedsTest, WhatIsNeverFoundIsGivenUpSooner) {
  DepthSeedOptions options;
  options.max_first_misses = 2;
  options.max_misses = 50;
  begin(options, 99);
  const std::size_t all = seeds_->size();
  look(0.3);
  EXPECT_GT(seeds_->size() + ready(), all - 1);
  look(0.32);
  EXPECT_LT(seeds_->size(), all / 4);
}

TEST_F(DepthSeedsTest, WhatIsLostIsGivenUpAfterSomeMisses) {
  DepthSeedOptions options;
  options.near_error = 1e-6;
  options.far_error = 0;
  options.max_misses = 2;
  begin(options);
  look(0.2);
  const std::size_t seen = seeds_->size();
  ASSERT_GT(seen, 25U);
  scene_ = testing::RenderedScene(rig_, kRoom, 99);  // something else is there
  look(0.4);
  EXPECT_GT(seeds_->size(), 9 * seen / 10);
  look(0.6);
  EXPECT_LT(seeds_->size(), seen / 3);
}

/// From where the corner was seen first, nothing can be learnt, and nothing counts as missed.
TEST_F(DepthSeedsTest, ACameraThatStandsLooksForNothing) {
  begin({}, 99);
  const std::size_t all = seeds_->size();
  for (int frame = 0; frame < 5; ++frame) look(0.001);
  EXPECT_EQ(seeds_->size(), all);
}

/// Where points are missing: rays until the depth is known, and then points in their place.
TEST_F(DepthSeedsTest, LentRaysBecomePointsWhereTheyStand) {
  begin({});
  const std::size_t all = seeds_->size();
  seeds_->lend_rays(kMedianDepth, ready_);
  seeds_->lend_rays(kMedianDepth, ready_);
  ASSERT_EQ(ready(), all) << "each once";
  std::vector<Eigen::Vector2f> places;
  for (const ImmaturePoint& ray : ready_.points()) {
    EXPECT_TRUE(ray.is_ray());
    places.push_back(ray.appearance.uv);
  }
  look(0.5);
  ASSERT_EQ(ready(), all);
  std::size_t points = 0;
  for (std::size_t i = 0; i < all; ++i) {
    EXPECT_EQ(ready_.points()[i].appearance.uv, places[i]);
    points += ready_.points()[i].is_ray() ? 0 : 1;
  }
  EXPECT_EQ(points, all - seeds_->size());
  EXPECT_GT(points, all / 2);
}

TEST_F(DepthSeedsTest, ARayEndsWithItsSeed) {
  begin({}, 99);
  seeds_->lend_rays(kMedianDepth, ready_);
  const std::size_t all = ready();
  look(0.3);
  look(0.32);
  ASSERT_LT(seeds_->size(), all / 4);
  ready_.drop_stale(kAnchor, 4, 3);
  EXPECT_EQ(ready(), seeds_->size());
}

TEST_F(DepthSeedsTest, TheOldAreGivenUp) {
  begin({});
  const DepthSeedOptions options;
  const auto newest = index(kAnchor) + static_cast<std::uint32_t>(options.max_age);
  seeds_->begin_keyframe(KeyframeId{newest});
  EXPECT_GT(seeds_->size(), 0U);
  seeds_->begin_keyframe(KeyframeId{newest + 1});
  EXPECT_EQ(seeds_->size(), 0U);
}

/// What came of corners that were seen through a rolling shutter.
struct RolledPoints {
  std::size_t count = 0;
  double depth_error = 0;  ///< median, as a share
  double anchor_px = 0;    ///< the worst of where the anchor is said to have seen them at mid-exposure
};

/// Seen from the middle of the room turning one way, then from 0.3 m to the right turning back, 30 ms from
/// the first row to the last, by who takes it for so many seconds.
RolledPoints rolled_points(double assumed_readout) {
  Rig rig = testing::test_rig(SensorKind::kMono, 320, 240);
  rig.readout = 0.03;
  const Vector6 turning = (Vector6() << 0, 0, 0, 0.1, 0.8, 0).finished();
  const SE3 T_c_a(SO3(), Vector3(-0.3, 0, 0));
  const RollingShutter first(rig, turning), later(rig, -turning);
  testing::RenderedScene scene(rig, {3, 2, kMedianDepth}, 21);
  ImagePyramid first_image, later_image;
  first_image.build(scene.render_rows([&](int row) { return first.T_row_c(row); }, 1));
  later_image.build(scene.render_rows([&](int row) { return later.at_row(row, T_c_a); }, 1));

  rig.readout = assumed_readout;
  DepthSeeds seeds(rig, {}, {}, 300);
  for (const PointAppearance& appearance : corners_of(rig, first_image))
    seeds.add(kAnchor, appearance, RollingShutter(rig, turning));
  ImmaturePoints ready(300, 1);
  seeds.observe(
      later_image, RollingShutter(rig, -turning), kMedianDepth, [&](KeyframeId) { return T_c_a; }, ready);

  RolledPoints result{.count = ready.points().size()};
  std::vector<double> errors;
  for (const ImmaturePoint& point : ready.points()) {
    const Vector2 uv = point.appearance.uv.cast<double>();
    const SE3 T_row_a = first.T_row_c(uv.y());
    const Vector3 x_a = T_row_a.inverse() * (rig.camera.unproject(uv) * scene.depth(T_row_a, uv));
    errors.push_back(std::abs(point.psi.z() * x_a.z() - 1));
    const Vector2 seen = point.anchor_observation.pixel.head<2>().cast<double>();
    result.anchor_px = std::max(result.anchor_px, (seen - rig.camera.project(x_a)).norm());
  }
  if (!errors.empty()) result.depth_error = median(std::span(errors));
  return result;
}

TEST(RollingDepthSeeds, PointsAreWhereAGlobalShutterWouldHaveSeenThem) {
  const RolledPoints known = rolled_points(0.03);
  EXPECT_GT(known.count, 25U);
  EXPECT_LT(known.depth_error, 0.03);
  EXPECT_LT(known.anchor_px, 0.1);
  const RolledPoints ignored = rolled_points(0);
  ASSERT_GT(ignored.count, 10U);
  EXPECT_GT(ignored.depth_error, 2 * known.depth_error);
  EXPECT_GT(ignored.anchor_px, 1);
}

}  // namespace
}  // namespace twofold
