// What a lost camera is compared with.
#include "tracking/loss/earlier_views.hpp"

#include <gtest/gtest.h>

#include "fixtures/rendered_scene.hpp"

namespace twofold {
namespace {

using namespace testing;

class EarlierViewsTest : public ::testing::Test {
 protected:
  EarlierViewsTest() { views_.prepare(corners_); }

  const FrameImages& see(double yaw) {
    scene_.render(T_c_w(yaw), 2, now_);
    views_.begin_frame();
    return now_;
  }
  static SE3 T_c_w(double yaw) { return {SO3::exp(Vector3(0.02, yaw, 0)), Vector3(0.5 * yaw, 0, 0)}; }
  double error(RecentView& view, double yaw_of_view, double yaw) {
    const auto found = views_.find(view.images, view.corners);
    if (!found) return 1;
    return (*found * (T_c_w(yaw) * T_c_w(yaw_of_view).inverse()).inverse()).log().norm();
  }

  const Rig rig_ = test_rig(SensorKind::kStereo, 320, 240);
  RenderedScene scene_{rig_, {3, 2, 5}, 21};
  EarlierViews views_{rig_, {}, {}, 4};
  FrameImages now_;
  FrameCorners corners_;
};

TEST_F(EarlierViewsTest, KnowWhereAFrameIsFromWhatTheNewestKeyframesSaw) {
  for (int i = 0; i < 6; ++i) views_.add_keyframe(KeyframeId{static_cast<std::uint32_t>(i)}, see(0.02 * i));
  ASSERT_EQ(views_.keyframes().size(), 4U);
  EXPECT_EQ(views_.keyframes()[0].id, KeyframeId{5});
  views_.look_at(see(0.3));
  for (std::size_t age = 0; age < 4; ++age) {
    const double yaw = 0.02 * (5 - static_cast<double>(age));
    EXPECT_LT(error(views_.keyframes()[age], yaw, 0.3), 0.1) << age;
  }
}

TEST_F(EarlierViewsTest, TheFrameAskedAboutIsKeptWhileTheCameraMovesOn) {
  views_.ask(see(0));
  views_.look_at(see(0.25));
  EXPECT_LT(error(views_.asked(), 0, 0.25), 0.1);
}

TEST_F(EarlierViewsTest, AnAnswerIsTakenOnce) {
  EXPECT_FALSE(views_.take_answer());
  views_.answer({KeyframeId{4}, SE3()});
  const auto answer = views_.take_answer();
  ASSERT_TRUE(answer);
  EXPECT_EQ(answer->reference, KeyframeId{4});
  EXPECT_FALSE(views_.take_answer());
}

TEST_F(EarlierViewsTest, CornersAreThoseOfAFrameThatWasLookedAt) {
  views_.look_at(see(0));
  views_.copy_corners(corners_);
  EXPECT_TRUE(corners_.described);
  EXPECT_GT(corners_.corners.size(), 50U);
  views_.add_keyframe(KeyframeId{1}, now_);
  EXPECT_EQ(views_.keyframes()[0].corners.corners.size(), corners_.corners.size());
  see(0.1);
  views_.copy_corners(corners_);
  EXPECT_FALSE(corners_.described);
  EXPECT_TRUE(corners_.corners.empty());
}

TEST(EarlierViews, FindNothingWhereTheWideSearchIsOff) {
  EXPECT_TRUE(EarlierViews(test_rig(SensorKind::kMono, 320, 240), {}, {}, 4).can_find());
  WideSearchOptions without;
  without.enabled = false;
  EXPECT_FALSE(EarlierViews(test_rig(SensorKind::kStereo, 320, 240), without, {}, 4).can_find());
  EXPECT_TRUE(EarlierViews(test_rig(SensorKind::kStereo, 320, 240), {}, {}, 4).can_find());
}

}  // namespace
}  // namespace twofold
