#include "loopclosure/depth_regression.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>
#include <utility>
#include <vector>

#include "geometry/inverse_depth.hpp"
#include "graph/graph_writer.hpp"

namespace twofold {
namespace {

/// Points of the map, seen from a keyframe that is elsewhere than their anchor.
class DepthRegressionTest : public ::testing::Test {
 protected:
  static constexpr KeyframeId kAnchor{0}, kSeenFrom{1};

  DepthRegressionTest() {
    for (const KeyframeId id : {kAnchor, kSeenFrom}) {
      Keyframe keyframe;
      keyframe.id = id;
      keyframe.part = kAnchor;
      if (id == kSeenFrom) keyframe.T_k_w = SE3(SO3::exp({0, 0.05, 0}), {0.2, 0, 0.1});
      writer_.add_keyframe(keyframe);
    }
  }
  /// @param uv, depth  in the keyframe it is seen from
  void add_point(const Vector2& uv, double depth) {
    const PointId id{static_cast<std::uint32_t>(writer_.graph().point_count())};
    const GraphSnapshot& graph = writer_.graph();
    MapPoint point;
    point.anchor = kAnchor;
    point.psi = to_inverse_depth(graph.T_k_w(kAnchor) * graph.T_k_w(kSeenFrom).inverse() *
                                 (camera_.unproject(uv) * depth));
    writer_.add_point(id, point);
    Observation observation;
    observation.point = id;
    observation.pixel = {0, 0, 0};  // where it was measured makes no difference
    writer_.add_observations(kSeenFrom, std::span(&observation, 1));
  }
  std::optional<double> depth_at(const Vector2& uv) {
    regression_.learn(writer_.graph(), kSeenFrom);
    return regression_.depth_at(uv);
  }

  const PinholeCamera camera_{400, 400, 320, 240, 640, 480};
  GraphWriter writer_;
  DepthRegression regression_{camera_};
};

TEST_F(DepthRegressionTest, ACornerIsAsDeepAsThePointsAroundIt) {
  add_point({300, 200}, 4);
  EXPECT_NEAR(depth_at({301, 200}).value_or(0), 4, 1e-9);
  add_point({310, 200}, 5);
  EXPECT_NEAR(1 / depth_at({305, 200}).value_or(0), (1.0 / 4 + 1.0 / 5) / 2, 1e-9)
      << "the mean of inverse depths";
  EXPECT_GT(depth_at({307, 200}).value_or(0), depth_at({305, 200}).value_or(0))
      << "the nearer one counts for more";
}

TEST_F(DepthRegressionTest, TheNearestThreePointsAreAsked) {
  for (const double u : {300.0, 302.0, 304.0}) add_point({u, 200}, 4);
  add_point({315, 200}, 4.9);
  EXPECT_NEAR(depth_at({301, 200}).value_or(0), 4, 1e-9);
}

TEST_F(DepthRegressionTest, TheOrderOfPointsMakesNoDifference) {
  const std::vector<Vector2> places = {{300, 230}, {330, 170}, {306, 204},
                                       {290, 190}, {312, 199}, {305, 215}};
  for (const Vector2& uv : places) add_point(uv, 3.6 + 0.01 * (uv.x() - 290));
  // Nearest to (305, 203): (306, 204), (312, 199), (305, 215).
  double sum = 0, weights = 0;
  for (const std::size_t n : {2, 4, 5}) {
    const double weight = 1 / (places[n] - Vector2(305, 203)).squaredNorm();
    sum += weight / (3.6 + 0.01 * (places[n].x() - 290));
    weights += weight;
  }
  EXPECT_NEAR(depth_at({305, 203}).value_or(0), weights / sum, 1e-9);
}

TEST_F(DepthRegressionTest, FarFromAllPointsNothingIsKnown) {
  EXPECT_FALSE(depth_at({300, 200}));
  add_point({300, 200}, 4);
  const double reach = DepthRegressionOptions().max_distance_share * camera_.width;
  EXPECT_TRUE(depth_at({300 + reach - 0.1, 200}));
  EXPECT_FALSE(depth_at({300 + reach + 0.1, 200}));
}

TEST_F(DepthRegressionTest, AcrossAnEdgeOfDepthNothingIsKnown) {
  const double ratio = DepthRegressionOptions().max_depth_ratio;
  add_point({300, 200}, 4);
  add_point({310, 200}, 0.99 * 4 * ratio);
  EXPECT_TRUE(depth_at({305, 200}));
  add_point({305, 210}, 1.01 * 4 * ratio);
  EXPECT_FALSE(depth_at({305, 203}));
}

TEST_F(DepthRegressionTest, PointsBehindTheCameraSayNothing) {
  add_point({300, 200}, -4);
  EXPECT_FALSE(depth_at({300, 200}));
}

TEST_F(DepthRegressionTest, DepthsFollowTheMapsUnit) {
  add_point({300, 200}, 4);
  ASSERT_TRUE(depth_at({300, 200}));
  const Vector3 psi = writer_.graph().point(PointId{0}).psi;
  writer_.set_inverse_depth(PointId{0}, {psi.x(), psi.y(), psi.z() / 2});
  const SE3 T = writer_.graph().keyframe(kSeenFrom).T_k_w;
  writer_.set_pose(kSeenFrom, SE3(T.so3(), 2 * T.translation()));
  EXPECT_NEAR(depth_at({300, 200}).value_or(0), 8, 1e-9);
}

TEST_F(DepthRegressionTest, DepthsAreWrittenAsASecondCameraWouldMeasureThem) {
  add_point({300, 200}, 4);
  PlaceAppearance view;
  view.corners.resize(2);
  view.corners[0].uv = {300, 200};
  view.corners[1].uv = {100, 400};
  regression_.learn(writer_.graph(), kSeenFrom);
  regression_.fill(view, 0.5);
  ASSERT_EQ(view.pixels.size(), 2U);
  EXPECT_NEAR(view.pixels[0].z(), 300 - 400 * 0.5 / 4, 1e-4);
  EXPECT_EQ(view.pixels[0].head<2>(), view.corners[0].uv);
  EXPECT_TRUE(std::isnan(view.pixels[1].z()));
}

/// Wherever the points are, some of them beside the image: its cells hide none that is within reach.
TEST_F(DepthRegressionTest, TheNearestPointsCountWhicheverCellTheyAreIn) {
  std::mt19937 random(3);
  std::uniform_real_distribution<double> u(-20, 660), v(-20, 500), depth(4, 4.5);
  std::vector<std::pair<Vector2, double>> points;
  for (int n = 0; n < 300; ++n) {
    points.emplace_back(Vector2(u(random), v(random)), depth(random));
    add_point(points.back().first, points.back().second);
  }
  regression_.learn(writer_.graph(), kSeenFrom);
  int known = 0;
  for (int n = 0; n < 500; ++n) {
    const Vector2 uv(std::clamp(u(random), 0.0, 639.0), std::clamp(v(random), 0.0, 479.0));
    std::sort(points.begin(), points.end(),
              [&](const auto& a, const auto& b) { return (a.first - uv).norm() < (b.first - uv).norm(); });
    double sum = 0, weights = 0;
    for (std::size_t k = 0; k < 3; ++k) {
      const double distance = (points[k].first - uv).norm();
      if (distance > 0.04 * camera_.width) break;
      const double weight = 1 / std::max(1.0, distance * distance);
      sum += weight / points[k].second;
      weights += weight;
    }
    const auto found = regression_.depth_at(uv);
    ASSERT_EQ(found.has_value(), sum > 0) << uv.transpose();
    if (!found) continue;
    EXPECT_NEAR(*found, weights / sum, 1e-6) << uv.transpose();
    ++known;
  }
  EXPECT_GT(known, 300);
}

}  // namespace
}  // namespace twofold
