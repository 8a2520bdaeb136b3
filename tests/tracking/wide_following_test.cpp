// Corners of a camera that comes near a wall by a quarter of its distance in one step.
#include "tracking/monocular/wide_following.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <vector>

#include "fixtures/rendered_scene.hpp"
#include "tracking/search/point_starter.hpp"

namespace twofold {
namespace {

class WideFollowingTest : public ::testing::TestWithParam<std::uint32_t> {
 protected:
  WideFollowingTest() {
    scene_.render(SE3(), 1, previous_);
    scene_.render(T_cur_prev_, 1, current_);
    NewPointOptions options;
    options.max_points = 300;
    options.cell_px = 20;
    PointStarter starter(rig_, options, {});
    starter.clear();
    std::vector<PointAppearance> chosen;
    chosen.reserve(300);
    starter.choose_corners(previous_, 300, chosen);
    for (const PointAppearance& appearance : chosen)
      corners_.push_back({appearance, appearance.uv, std::nullopt});
    for (FollowedCorner& corner : corners_)
      seen_.push_back(follow_corner(previous_.left, current_.left, {}, corner) ? 1 : 0);
  }
  /// Where the current frame sees a corner.
  [[nodiscard]] Vector2 truth(const FollowedCorner& corner) const {
    const Vector2 uv = corner.appearance.uv.cast<double>();
    return rig_.camera.project(T_cur_prev_ * (scene_.depth(SE3(), uv) * rig_.camera.unproject(uv)));
  }
  /// With room for its patch.
  [[nodiscard]] bool is_inside(const Vector2& uv) const {
    constexpr double kRim = 12;
    return uv.x() > kRim && uv.y() > kRim && uv.x() < rig_.camera.width - kRim &&
           uv.y() < rig_.camera.height - kRim;
  }
  /// Of the corners found: at the right place, elsewhere, and such as have left the view.
  struct Count {
    int right = 0, wrong = 0, gone = 0;
  };
  [[nodiscard]] Count count() const {
    Count result;
    for (std::size_t i = 0; i < corners_.size(); ++i) {
      if (seen_[i] == 0) continue;
      const Vector2 there = truth(corners_[i]);
      const bool right = (corners_[i].uv.cast<double>() - there).norm() < 2;
      ++(right ? result.right : is_inside(there) ? result.wrong : result.gone);
    }
    return result;
  }

  const Rig rig_ = testing::test_rig(SensorKind::kMono);
  const SE3 T_cur_prev_{SO3::exp(Vector3(0.01, -0.02, 0)), Vector3(0.05, 0, -1.0)};
  testing::RenderedScene scene_{rig_, {2.5, 2, 3.5}, GetParam()};
  FrameImages previous_, current_;
  std::vector<FollowedCorner> corners_;
  std::vector<char> seen_;
};

TEST_P(WideFollowingTest, FindsWhatCannotBeFollowed) {
  const int in_view = static_cast<int>(std::count_if(
      corners_.begin(), corners_.end(), [&](const FollowedCorner& c) { return is_inside(truth(c)); }));
  ASSERT_GT(in_view, 60);
  const Count before = count();
  ASSERT_LT(before.right, 0.4 * in_view) << "the step is not wide";
  WideFollowing following(rig_, {});
  following.follow(previous_.left, current_.left, corners_, seen_);
  const Count after = count();
  EXPECT_GT(after.right, 0.65 * in_view);
  EXPECT_LE(after.wrong - before.wrong, 0.05 * after.right);
  // What they were taken for lies on their epipolar lines: the start's adjustment puts them aside.
  EXPECT_LE(after.gone - before.gone, 0.15 * (static_cast<double>(corners_.size()) - in_view));
}
INSTANTIATE_TEST_SUITE_P(Rooms, WideFollowingTest, ::testing::Values(1, 2, 3));

/// Another place: nothing is found that is not there.
TEST_P(WideFollowingTest, FindsNothingInAnotherPlace) {
  testing::RenderedScene other(rig_, {2.5, 2, 3.5}, 1234);
  FrameImages elsewhere;
  other.render(T_cur_prev_, 1, elsewhere);
  std::fill(seen_.begin(), seen_.end(), 0);
  WideFollowing following(rig_, {});
  following.follow(previous_.left, elsewhere.left, corners_, seen_);
  EXPECT_LT(std::count(seen_.begin(), seen_.end(), 1), 10);
}

}  // namespace
}  // namespace twofold
