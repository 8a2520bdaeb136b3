#include "tracking/depth/depth_planes.hpp"

#include <gtest/gtest.h>

#include <algorithm>

#include "tests/tracking/tracked_sequence.hpp"

namespace twofold {
namespace {

using testing::test_rig;

/// Slats of a wall 2 m away: 20 pixels of readings, 4 without. Only the finest cells fit between the gaps,
/// and more of them than planes are kept.
TEST(DepthPlanesTest, TheCapOnPlanesLeavesNoPartOfTheImageOut) {
  const Rig rig = test_rig(SensorKind::kRgbd, 640, 480);
  cv::Mat depth(480, 640, CV_16UC1, cv::Scalar(2 / rig.depth_unit));
  for (int u = 0; u < depth.cols; u += 24) depth.colRange(u, std::min(u + 4, depth.cols)).setTo(0);

  DepthPlanes planes(rig, {});
  planes.read(depth);
  const auto total = static_cast<double>(planes.planes().size());
  ASSERT_GT(total, 5000);
  for (int quarter = 0; quarter < 4; ++quarter) {
    const auto here =
        std::count_if(planes.planes().begin(), planes.planes().end(), [&](const DepthPlanes::Plane& plane) {
          return static_cast<int>(rig.camera.project(plane.x).y()) / 120 == quarter;
        });
    EXPECT_NEAR(static_cast<double>(here) / total, 0.25, 0.05) << "quarter " << quarter << " from the top";
  }
  int shown = 0;  // by what is looked up, too
  for (int v = 360; v < 470; ++v) shown += planes.at(Vector2(12, v)) != nullptr ? 1 : 0;
  EXPECT_GT(shown, 50);
}

}  // namespace
}  // namespace twofold
