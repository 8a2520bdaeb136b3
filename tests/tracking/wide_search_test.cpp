#include "tracking/loss/wide_search.hpp"

#include <gtest/gtest.h>

#include <array>
#include <string>

#include "fixtures/rendered_scene.hpp"

namespace twofold {
namespace {

using namespace testing;

class WideSearchTest : public ::testing::TestWithParam<SensorKind> {
 protected:
  const Rig rig_ = test_rig(GetParam(), 320, 240);
};

TEST_P(WideSearchTest, FindsAMotionThatNothingForetold) {
  RenderedScene scene(rig_, {3, 2, 5}, 21);
  FrameImages previous, current;
  scene.render(SE3(), 2, previous);
  WideSearch search(rig_, {});
  FrameCorners corners;
  for (const double yaw : {-0.3, -0.15, 0.15, 0.3}) {
    const SE3 T_cur_prev(SO3::exp(Vector3(0.05, yaw, 0.04)), Vector3(0.1, -0.05, 0.15));
    scene.render(T_cur_prev, 2, current);
    search.look_at(current);
    const auto found = search.find(previous, corners, {});
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
  WideSearch search(rig_, {});
  FrameCorners corners;
  search.look_at(current);
  EXPECT_FALSE(search.find(previous, corners, {}));
}

// The frame sought for is an earlier one in its turn: its corners need not be found again.
TEST_P(WideSearchTest, KnownCornersGiveWhatFreshOnesDo) {
  RenderedScene scene(rig_, {3, 2, 5}, 21);
  FrameImages first, second, third;
  scene.render(SE3(), 2, first);
  scene.render(SE3(SO3::exp(Vector3(0, 0.1, 0)), Vector3(0.1, 0, 0)), 2, second);
  scene.render(SE3(SO3::exp(Vector3(0, 0.2, 0)), Vector3(0.2, 0, 0)), 2, third);
  WideSearch search(rig_, {});
  FrameCorners of_first, fresh;
  search.look_at(second);
  ASSERT_TRUE(search.find(first, of_first, {}));
  FrameCorners kept = search.corners();
  search.look_at(third);
  const auto with_kept = search.find(second, kept, {});
  const auto with_fresh = search.find(second, fresh, {});
  ASSERT_TRUE(with_kept && with_fresh);
  EXPECT_EQ(with_kept->matrix(), with_fresh->matrix());
  EXPECT_EQ(search.find(second, kept, {})->matrix(), with_fresh->matrix());
}

// It has no depth, but far points are where the rotation takes them.
TEST(WideSearchOfOneCamera, FindsWhichWayItTurned) {
  const Rig rig = test_rig(SensorKind::kMono, 320, 240);
  RenderedScene scene(rig, {3, 2, 5}, 21), other(rig, {3, 2, 5}, 1234);
  FrameImages previous, current;
  scene.render(SE3(), 2, previous);
  WideSearch search(rig, {});
  FrameCorners corners;
  for (const double yaw : {-0.45, 0.3, 0.45}) {
    const SE3 T_cur_prev(SO3::exp(Vector3(0.05, yaw, 0.04)), Vector3(0.02, -0.01, 0.03));
    scene.render(T_cur_prev, 2, current);
    search.look_at(current);
    const auto found = search.find(previous, corners, {});
    ASSERT_TRUE(found) << yaw;
    EXPECT_EQ(found->translation(), Vector3(0, 0, 0));
    EXPECT_LT((found->so3().inverse() * T_cur_prev.so3()).log().norm(), 0.03) << yaw;
  }
  other.render(SE3(), 2, current);
  search.look_at(current);
  EXPECT_FALSE(search.find(previous, corners, {})) << "another place";
}

INSTANTIATE_TEST_SUITE_P(Sensors, WideSearchTest, ::testing::Values(SensorKind::kStereo, SensorKind::kRgbd),
                         [](const auto& sensor) {
                           return sensor.param == SensorKind::kStereo ? "Stereo" : "Rgbd";
                         });

}  // namespace
}  // namespace twofold
