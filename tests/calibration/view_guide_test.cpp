#include "calibration/view_guide.hpp"

#include <gtest/gtest.h>

#include "calibration/view_collector.hpp"
#include "fixtures/rendered_board.hpp"

namespace twofold {
namespace {

using namespace twofold::testing;

BoardView view_at(const SO3& R, const Vector3& centre_c) {
  const CameraModel camera = test_camera(520, 320, 240, 0, 0, 0, 0);
  BoardView view;
  for (int id = 0; id < kBoard.corner_count(); ++id) {
    const cv::Point3f p = kBoard.corner(id);
    const Vector2 uv = camera.project(R.matrix() * Vector3(p.x - 0.1, p.y - 0.0625, 0) + centre_c);
    view.ids.push_back(id);
    view.pixels.emplace_back(static_cast<float>(uv.x()), static_cast<float>(uv.y()));
  }
  return view;
}

bool asks_for(const ViewGuide& guide, const std::string& part) {
  for (const std::string& text : guide.missing()) {
    if (text.find(part) != std::string::npos) return true;
  }
  return false;
}

TEST(ViewShape, TellsWhichSideIsFartherAway) {
  const auto yaw = shape_of(view_at(SO3::exp(Vector3(0, -0.4, 0)), {0, 0, 0.4}), kBoard, kImageSize);
  ASSERT_TRUE(yaw.has_value());
  EXPECT_NEAR(yaw->yaw(), 0.4, 0.08);  // a turn about -y takes the right side away
  EXPECT_NEAR(yaw->pitch(), 0, 0.05);
  const auto pitch = shape_of(view_at(SO3::exp(Vector3(0.4, 0, 0)), {0, 0, 0.4}), kBoard, kImageSize);
  ASSERT_TRUE(pitch.has_value());
  EXPECT_NEAR(pitch->pitch(), 0.4, 0.08);  // about x: the lower side
}

/// A corner of a ChArUco board that is found in every other frame does not make it move.
TEST(ViewCollector, ABoardRestsWhileSingleCornersComeAndGo) {
  const BoardView whole = view_at(SO3(), {0, 0, 0.4});
  BoardView part = whole;
  part.ids.erase(part.ids.begin() + 7);
  part.pixels.erase(part.pixels.begin() + 7);
  EXPECT_EQ(movement(whole, part), 0);
  EXPECT_EQ(movement(part, whole), 0);
  part.pixels[20].x += 3;
  EXPECT_NEAR(movement(whole, part), 3, 1e-4);
  BoardView few;
  few.ids.assign(whole.ids.begin(), whole.ids.begin() + 10);
  few.pixels.assign(whole.pixels.begin(), whole.pixels.begin() + 10);
  EXPECT_FALSE(std::isfinite(movement(whole, few)));
  EXPECT_FALSE(std::isfinite(movement({}, whole)));
}

TEST(ViewGuide, TakesOnlyNewViews) {
  ViewGuide guide(kBoard, kImageSize);
  EXPECT_TRUE(guide.offer(view_at(SO3(), {0, 0, 0.4})));
  EXPECT_FALSE(guide.offer(view_at(SO3(), {0.001, 0, 0.4})));
  EXPECT_TRUE(guide.offer(view_at(SO3(), {0.08, 0, 0.4})));
  EXPECT_EQ(guide.chosen(), (std::vector<int>{0, 2}));
}

TEST(ViewGuide, AsksForWhatIsMissingUntilNothingIs) {
  ViewGuideOptions options;
  options.wanted_views = 9;
  ViewGuide guide(kBoard, kImageSize, options);
  EXPECT_TRUE(guide.offer(view_at(SO3(), {-0.08, -0.08, 0.4})));
  for (const char* part :
       {"upper right", "right side", "left side", "lower side", "upper side", "nearer", "8 more"})
    EXPECT_TRUE(asks_for(guide, part)) << part;
  guide.offer(view_at(SO3::exp(Vector3(0, -0.5, 0)), {0, 0, 0.4}));
  EXPECT_FALSE(asks_for(guide, "right side"));
  EXPECT_TRUE(asks_for(guide, "left side"));
  guide.offer(view_at(SO3::exp(Vector3(0, 0.5, 0)), {0, 0, 0.4}));
  guide.offer(view_at(SO3::exp(Vector3(0.5, 0, 0)), {0, 0, 0.4}));
  guide.offer(view_at(SO3::exp(Vector3(-0.5, 0, 0)), {0, 0, 0.4}));
  EXPECT_FALSE(asks_for(guide, "side"));
  EXPECT_TRUE(guide.offer(view_at(SO3(), {0, 0, 0.8})));
  EXPECT_FALSE(asks_for(guide, "nearer"));
  for (const double x : {-0.12, 0.12}) {
    for (const double y : {-0.11, 0.11}) guide.offer(view_at(SO3(), {x, y, 0.4}));
  }
  EXPECT_EQ(guide.missing(), std::vector<std::string>{});
}

TEST(ViewGuide, ThinsOutALongRecording) {
  ViewGuideOptions options;
  options.max_views = 12;
  options.wanted_views = 10;
  ViewGuide guide(kBoard, kImageSize, options);
  std::mt19937 random(4);
  for (int i = 0; i < 400; ++i) {
    const SE3 T_c_b = random_pose(kBoard, 0.5, random);
    guide.offer(view_at(T_c_b.so3(), T_c_b * Vector3(0.1, 0.0625, 0)));
    ASSERT_LE(guide.chosen().size(), 12U);
  }
  EXPECT_GE(guide.chosen().size(), 5U);
  EXPECT_GT(guide.chosen().back(), 0);
  EXPECT_TRUE(std::is_sorted(guide.chosen().begin(), guide.chosen().end()));
}

}  // namespace
}  // namespace twofold
