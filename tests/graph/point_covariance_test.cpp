#include "graph/point_covariance.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "tests/graph/graph_pieces.hpp"

namespace twofold {
namespace {

using testing::add_keyframe;
using testing::anchored_in;

constexpr double kDepth = 4;  // [m]

Rig stereo_rig() {
  Rig rig;
  rig.camera = {400, 400, 320, 240, 640, 480};
  rig.baseline = 0.2;
  return rig;
}

/// A point that is seen half-way between the two cameras of each keyframe, `kDepth` in front of them.
GraphSnapshot seen_from(const Rig& rig, const std::vector<SE3>& poses, bool right = true) {
  GraphWriter writer;
  const Vector3 x_k(rig.baseline / 2, 0, kDepth);
  for (const SE3& T_k_w : poses) {
    const KeyframeId k = add_keyframe(writer, T_k_w);
    if (k == KeyframeId{0}) {
      MapPoint point = anchored_in(k);
      point.psi = {x_k.x() / kDepth, 0, 1 / kDepth};
      writer.add_point(PointId{0}, point);
    }
    Observation observation;
    observation.point = PointId{0};
    observation.pixel = rig.project(x_k).cast<float>();
    if (!right) observation.pixel.z() = Rig::kNoRight;
    writer.add_observations(k, std::vector{observation});
  }
  return writer.publish();
}

/// By hand: both columns tell of x, the row of y, and the disparity of z.
Matrix3 of_one_view(const Rig& rig) {
  const double f = rig.camera.fx, variance = rig.noise.sigma_px * rig.noise.sigma_px;
  const double across = variance * kDepth * kDepth / (f * f);
  const double along = 2 * variance * std::pow(kDepth, 4) / std::pow(f * rig.baseline, 2);
  return Vector3(across / 2, across, along).asDiagonal();
}

TEST(PointCovariance, OfOneStereoViewIsThatOfItsTriangulation) {
  const Rig rig = stereo_rig();
  const auto covariance = point_covariance(rig, seen_from(rig, {SE3()}), PointId{0});
  ASSERT_TRUE(covariance);
  EXPECT_LT((*covariance - of_one_view(rig)).norm(), 1e-6 * of_one_view(rig).norm());
}

TEST(PointCovariance, TurnsWithTheCameraIntoTheWorld) {
  const Rig rig = stereo_rig();
  const SE3 T_k_w(SO3::exp({0.3, -0.8, 0.2}), Vector3(1, 2, 3));
  const auto covariance = point_covariance(rig, seen_from(rig, {T_k_w}), PointId{0});
  ASSERT_TRUE(covariance);
  const Matrix3 R = T_k_w.rotation();
  EXPECT_LT((R * *covariance * R.transpose() - of_one_view(rig)).norm(), 1e-6 * of_one_view(rig).norm());
}

TEST(PointCovariance, ObserversAddUp) {
  const Rig rig = stereo_rig();
  const auto covariance = point_covariance(rig, seen_from(rig, {SE3(), SE3()}), PointId{0});
  ASSERT_TRUE(covariance);
  EXPECT_LT((2 * *covariance - of_one_view(rig)).norm(), 1e-6 * of_one_view(rig).norm());
}

TEST(PointCovariance, IsNoneWhereNobodyKnowsTheDepth) {
  const Rig rig = stereo_rig();
  EXPECT_FALSE(point_covariance(rig, seen_from(rig, {SE3()}, false), PointId{0}));
}

}  // namespace
}  // namespace twofold
