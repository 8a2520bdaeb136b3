#include "tracking/wide_search.hpp"

#include <gtest/gtest.h>

#include <vector>

#include "fixtures/rendered_scene.hpp"

namespace twofold {
namespace {

using namespace testing;

class WideSearchTest : public ::testing::TestWithParam<SensorKind> {
 protected:
  const Rig rig_ = test_rig(GetParam(), 320, 240);

  /// Points on a grid of the view from the origin.
  [[nodiscard]] std::vector<AlignmentPoint> points(const RenderedScene& scene) const {
    std::vector<AlignmentPoint> result;
    for (int v = 20; v < 230; v += 16) {
      for (int u = 20; u < 310; u += 16) {
        const Vector2 uv(u, v);
        result.push_back({uv.cast<float>(), rig_.camera.unproject(uv) * scene.depth(SE3(), uv)});
      }
    }
    return result;
  }
};

TEST_P(WideSearchTest, FindsAMotionThatNothingForetold) {
  RenderedScene scene(rig_, {3, 2, 5}, 21);
  FrameImages previous, current;
  scene.render(SE3(), 2, previous);
  const std::vector<AlignmentPoint> all = points(scene);
  WideSearch search(rig_, 300, {});
  for (const double yaw : {-0.3, -0.15, 0.15, 0.3}) {
    const SE3 T_cur_prev(SO3::exp(Vector3(0.05, yaw, 0.04)), Vector3(0.1, -0.05, 0.15));
    scene.render(T_cur_prev, 2, current);
    const auto found = search.find(previous.left, current, all, {});
    ASSERT_TRUE(found) << yaw;
    const SE3 error = *found * T_cur_prev.inverse();
    EXPECT_LT(error.translation().norm(), 0.1) << yaw;
    EXPECT_LT(error.so3().log().norm(), 0.02) << yaw;
  }
}

TEST_P(WideSearchTest, FindsNothingInAnotherPlace) {
  RenderedScene scene(rig_, {3, 2, 5}, 21), other(rig_, {3, 2, 5}, 1234);
  FrameImages previous, current;
  scene.render(SE3(), 2, previous);
  other.render(SE3(), 2, current);
  EXPECT_FALSE(WideSearch(rig_, 300, {}).find(previous.left, current, points(scene), {}));
}

INSTANTIATE_TEST_SUITE_P(Sensors, WideSearchTest, ::testing::Values(SensorKind::kStereo, SensorKind::kRgbd),
                         [](const auto& sensor) {
                           return sensor.param == SensorKind::kStereo ? "Stereo" : "Rgbd";
                         });

}  // namespace
}  // namespace twofold
