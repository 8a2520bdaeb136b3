// Where points of the local map are found in a frame.
#include "tracking/search/local_map_search.hpp"

#include <gtest/gtest.h>

#include <set>

#include "fixtures/rendered_scene.hpp"
#include "tracking/effort_bounds.hpp"
#include "tracking/search/point_starter.hpp"

namespace twofold {
namespace {

using namespace testing;

/// A room seen from a keyframe, whose points are looked for in a frame some centimetres and degrees away.
class LocalMapSearchTest : public ::testing::Test {
 protected:
  static constexpr KeyframeId kFirst{0};

  LocalMapSearchTest() {
    FrameImages at_keyframe;
    scene_.render(SE3(), 2, at_keyframe);
    scene_.render(T_true_, 2, now_);
    immature_.add_pending({.id = kFirst, .reference = kNoKeyframe, .T_k_ref = SE3()});
    PointStarter(rig_, options_.new_points, options_.search)
        .start(at_keyframe, kFirst, RollingShutter(), immature_);
    local_map_.update(graph_, kFirst, immature_, 20);
  }
  FrameStep search(const SE3& T_c_ref, double radius_px, const EffortBounds& bounds) {
    FrameStep step(frame_, graph_, nullptr, bounds, 0);
    LocalMapSearch(rig_, options_.local_map, options_.search, local_map_, fixed_)
        .run(now_, T_c_ref, radius_px, step, outcome_);
    return step;
  }
  FrameStep search(const SE3& T_c_ref, double radius_px) { return search(T_c_ref, radius_px, bounds_); }
  /// Of the points found, those that are within 1 px of where they are seen.
  [[nodiscard]] std::size_t right_matches() const {
    return static_cast<std::size_t>(std::count_if(
        outcome_.matches.begin(), outcome_.matches.end(), [&](const SearchOutcome::Match& match) {
          const Vector2 truth = rig_.camera.project(T_true_ * local_map_.points()[match.point].x_ref);
          return (match.found.pixel.head<2>() - truth).norm() < 1;
        }));
  }

  const Rig rig_ = test_rig(SensorKind::kStereo, 320, 240);
  const SE3 T_true_{SO3::exp(Vector3(0.01, -0.03, 0.02)), Vector3(0.06, -0.02, 0.08)};
  RenderedScene scene_{rig_, {3, 2, 5}, 21};
  TrackerOptions options_;
  const EffortBounds bounds_ = bounds_of(EffortLevel::kEverything, options_);
  GraphSnapshot graph_ = GraphWriter().publish();
  FrameImages now_;
  Frame frame_;
  ImmaturePoints immature_{400, 1};
  LocalMap local_map_{400};
  FixedPixels fixed_{320, 240, {}};
  SearchOutcome outcome_{rig_, options_.local_map.max_searches};
};

TEST_F(LocalMapSearchTest, FindsThePointsFromWhereTheCameraIs) {
  ASSERT_GT(local_map_.points().size(), 60U);
  const FrameStep step = search(T_true_, 4);
  EXPECT_GT(static_cast<double>(right_matches()), 0.85 * static_cast<double>(local_map_.points().size()));
  EXPECT_GE(right_matches() + 2, outcome_.matches.size());
  EXPECT_EQ(step.result.matches, static_cast<int>(outcome_.matches.size()));
  EXPECT_EQ(step.result.searched, static_cast<int>(outcome_.matches.size() + outcome_.missed.size()));
  EXPECT_GT(step.result.reference_in_view, 0.9);
  std::set<std::uint32_t> looked_for(outcome_.missed.begin(), outcome_.missed.end());
  for (const auto& match : outcome_.matches)
    EXPECT_TRUE(looked_for.insert(match.point).second) << "once each";
}

TEST_F(LocalMapSearchTest, LooksNoFartherThanTheRadius) {
  const SE3 turned = SE3(SO3::exp(Vector3(0, 0.1, 0)), Vector3::Zero()) * T_true_;  // about 26 px
  (void)search(turned, 4);
  EXPECT_EQ(right_matches(), 0U) << "16 px on the coarsest level";
  (void)search(turned, 16);
  EXPECT_GT(right_matches(), 10U);
}

TEST_F(LocalMapSearchTest, RaysAreSearchedFromBesideWhereTheyStarted) {
  for (ImmaturePoint& point : immature_.points()) point.ray_sigma = 0.7 * point.psi.z();
  immature_.changed();
  local_map_.update(graph_, kFirst, immature_, 20);
  const SO3& turned = T_true_.so3();
  const FrameStep beside = search(SE3(turned, Vector3(0.002, 0, 0)), 16);
  EXPECT_GT(beside.result.candidates, 60);
  const FrameStep away = search(T_true_, 4);  // 0.1 m: nobody knows where they are seen
  EXPECT_LT(away.result.candidates, beside.result.candidates / 4);
}

TEST_F(LocalMapSearchTest, PointsOutOfViewAreNoCandidates) {
  const FrameStep away = search(SE3(SO3::exp(Vector3(0, 3, 0)), Vector3::Zero()), 4);
  EXPECT_EQ(away.result.candidates, 0);
  EXPECT_EQ(away.result.reference_in_view, 0);
  const FrameStep aside = search(SE3(SO3::exp(Vector3(0, 0.5, 0)), Vector3::Zero()), 4);
  EXPECT_LT(aside.result.reference_in_view, 0.7);
  EXPECT_GT(aside.result.reference_in_view, 0.1);
  EXPECT_EQ(aside.result.candidates, static_cast<int>(outcome_.candidates.size()));
}

TEST_F(LocalMapSearchTest, EndsWhenEnoughWasFoundOrLookedFor) {
  EffortBounds bounds = bounds_;
  bounds.wanted_matches = 10;
  EXPECT_EQ(search(T_true_, 4, bounds).result.matches, 10);
  EXPECT_GE(outcome_.candidates.next(), 0) << "some are left";
  bounds = bounds_;
  bounds.max_searches = 12;
  EXPECT_EQ(search(T_true_, 4, bounds).result.searched, 12);
}

TEST_F(LocalMapSearchTest, FindsPointsInOtherLight) {
  now_.left.build(0.3 * now_.left.level(0));
  now_.right.build(0.3 * now_.right.level(0));
  (void)search(T_true_, 4);
  EXPECT_GT(static_cast<double>(right_matches()), 0.85 * static_cast<double>(local_map_.points().size()));
  options_.local_map.light_missed_share = 2;  // more than there are
  (void)search(T_true_, 4);
  EXPECT_EQ(right_matches(), 0U) << "their patches are of another light";
}

}  // namespace
}  // namespace twofold
