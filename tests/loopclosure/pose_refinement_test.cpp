#include "loopclosure/pose_refinement.hpp"

#include <gtest/gtest.h>

#include <utility>

#include "geometry/inverse_depth.hpp"
#include "graph/graph_writer.hpp"
#include "imaging/corner_selection.hpp"
#include "imaging/fast_corners.hpp"
#include "imaging/patch.hpp"
#include "tests/loopclosure/turning_camera.hpp"

namespace twofold {
namespace {

using testing::pose;
using testing::RenderedScene;

/// A map of one keyframe in a rendered room, whose points know their true depth.
class PoseRefinementTest : public ::testing::Test {
 protected:
  Rig rig_ = testing::test_rig(SensorKind::kRgbd, 320, 240);
  const SE3 T_k_w_ = pose(0.1, {0.2, 0.1, 0});
  const SE3 T_c_w_ = pose(0.05, {0.1, 0.05, 0.2});
  GraphWriter writer_;
  GraphSnapshot graph_;
  FrameImages view_;

  PoseRefinementTest() {
    RenderedScene scene(rig_, Vector3(3, 2, 4), 1);
    scene.render(T_c_w_, 1.5, view_);
  }

  /// @param right_every  one in so many points has its own patch, the others one of `other_room`
  /// @param shift_px  four in nine points are so far beside where their patch is
  void make_map(int points, std::uint32_t other_room = 0, int right_every = 1, double shift_px = 0) {
    Keyframe keyframe;
    keyframe.id = KeyframeId{0};
    keyframe.T_k_w = T_k_w_;
    writer_.add_keyframe(keyframe);
    writer_.set_reference(keyframe.id);
    RenderedScene room(rig_, Vector3(3, 2, 4), 1), other(rig_, Vector3(3, 2, 4), other_room);
    FrameImages right, wrong;
    room.render(T_k_w_, 1.5, right);
    other.render(T_k_w_, 1.5, wrong);
    std::vector<DescribedCorner> corners;
    CornerSelector({}).select(right.left, corners);
    std::vector<Observation> observations;
    for (const DescribedCorner& corner : corners) {
      if (static_cast<int>(observations.size()) == points) break;
      if (corner.level > 0) continue;
      const PointId id{static_cast<std::uint32_t>(observations.size())};
      const FrameImages& from = index(id) % static_cast<std::uint32_t>(right_every) == 0 ? right : wrong;
      PointAppearance appearance;
      const auto u = static_cast<int>(corner.uv.x()), v = static_cast<int>(corner.uv.y());
      if (!cut_appearance(from.left.level(0), u, v, 0, appearance)) continue;
      const Vector2 uv = corner.uv.cast<double>();
      const double depth = room.depth(T_k_w_, uv);
      MapPoint point;
      point.anchor = KeyframeId{0};
      const double shift = index(id) % 9 < 5 ? 0 : shift_px;
      point.psi = to_inverse_depth(rig_.camera.unproject(uv + Vector2(0, shift)) * depth);
      point.appearance = std::make_shared<const PointAppearance>(appearance);
      writer_.add_point(id, point);
      const double u_r = uv.x() - rig_.disparity_from_depth(depth);
      observations.push_back({id, {corner.uv.x(), corner.uv.y(), static_cast<float>(u_r)}, 0});
    }
    writer_.add_observations(KeyframeId{0}, observations);
    graph_ = writer_.publish();
  }

  RefinementOutcome refine(const SE3& error, RefinedPlace& place, const RefinementOptions& options = {}) {
    return PoseRefinement(rig_, options).refine(graph_, KeyframeId{0}, view_, error * truth(), place);
  }
  [[nodiscard]] SE3 truth() const { return T_c_w_ * T_k_w_.inverse(); }
};

TEST_F(PoseRefinementTest, FindsThePoseFromTheMapsPoints) {
  make_map(200);
  RefinedPlace place;
  ASSERT_EQ(refine(SE3(SO3::exp({0, 0.01, 0}), Vector3(0.03, 0, 0.02)), place), RefinementOutcome::kRefined);
  EXPECT_LT((place.T_c_k * truth().inverse()).log().norm(), 0.01);
  EXPECT_GT(place.inliers, 60);
}

TEST_F(PoseRefinementTest, AMapWithFewPointsThereSaysNothing) {
  make_map(35);
  RefinedPlace place;
  EXPECT_EQ(refine(SE3(), place), RefinementOutcome::kTooFewPoints);
}

TEST_F(PoseRefinementTest, AnotherRoomContradicts) {
  make_map(200, 2, 1000);
  RefinedPlace place;
  EXPECT_EQ(refine(SE3(), place), RefinementOutcome::kContradicted);
}

TEST_F(PoseRefinementTest, FewerThanAreAskedForAreNoPlace) {
  make_map(200);
  RefinedPlace place;
  ASSERT_EQ(refine(SE3(), place), RefinementOutcome::kRefined);
  RefinementOptions options;
  options.min_inliers = place.inliers + 1;
  EXPECT_EQ(refine(SE3(), place, options), RefinementOutcome::kContradicted);
}

/// All of them are found, and nearly half of them do not stand where they should: things were moved, or the
/// pose is another.
TEST_F(PoseRefinementTest, PointsThatAreFoundElsewhereContradict) {
  make_map(200, 0, 1, 4);
  RefinementOptions options;
  options.second_radius_px = 5;
  RefinedPlace place;
  const double share = std::exchange(options.min_inlier_share, 0);
  ASSERT_EQ(refine(SE3(), place, options), RefinementOutcome::kRefined);
  ASSERT_GE(place.inliers, 2 * options.min_inliers);
  options.min_inlier_share = share;
  EXPECT_EQ(refine(SE3(), place, options), RefinementOutcome::kContradicted);
}

/// Once the first round has found the pose, what is found beside where it should be is something else.
TEST_F(PoseRefinementTest, TheSecondRoundLooksNearer) {
  make_map(200, 0, 1, 4);
  RefinedPlace place;
  PoseRefinement refinement(rig_, {});
  ASSERT_EQ(refinement.refine(graph_, KeyframeId{0}, view_, truth(), place), RefinementOutcome::kRefined);
  EXPECT_GT(place.inliers, 0.7 * static_cast<double>(refinement.found().size()));
}

TEST_F(PoseRefinementTest, PointsAtTheImagesBorderAreNotLookedFor) {
  make_map(200);
  RefinementOptions options;
  options.border_px = 100;
  RefinedPlace place;
  EXPECT_EQ(refine(SE3(), place, options), RefinementOutcome::kTooFewPoints);
}

TEST_F(PoseRefinementTest, LooksForNoMorePointsThanItMay) {
  make_map(200);
  RefinementOptions options;
  options.max_points = 60;
  RefinedPlace place;
  PoseRefinement refinement(rig_, options);
  ASSERT_EQ(refinement.refine(graph_, KeyframeId{0}, view_, truth(), place), RefinementOutcome::kRefined);
  EXPECT_LE(refinement.found().size(), 60U);
}

/// From where the map was made a point falls onto its pixel whatever its depth; from aside it does not, and
/// says no more of the pose than its depth is known.
TEST_F(PoseRefinementTest, FromAsideAPointTellsAsMuchAsItsDepthIsKnown) {
  make_map(200);
  RefinedPlace aside;
  ASSERT_EQ(refine(SE3(), aside), RefinementOutcome::kRefined);
  const SE3 beside = SE3(SO3(), Vector3(-0.002, 0, 0)) * T_k_w_;
  RenderedScene scene(rig_, Vector3(3, 2, 4), 1);
  scene.render(beside, 1.5, view_);
  RefinedPlace near;
  ASSERT_EQ(PoseRefinement(rig_, {}).refine(graph_, KeyframeId{0}, view_, beside * T_k_w_.inverse(), near),
            RefinementOutcome::kRefined);
  EXPECT_LT(1.0 * aside.weight / aside.inliers, 0.8 * near.weight / near.inliers);
}

/// Nearly half of the points that are found, and as well known as the others, are outliers.
TEST_F(PoseRefinementTest, OutliersAddNothingToTheWeight) {
  make_map(200, 0, 1, 4);
  RenderedScene scene(rig_, Vector3(3, 2, 4), 1);
  scene.render(T_k_w_, 1.5, view_);
  RefinementOptions options;
  options.second_radius_px = 5;
  options.min_inlier_share = 0;
  PoseRefinement refinement(rig_, options);
  RefinedPlace place;
  ASSERT_EQ(refinement.refine(graph_, KeyframeId{0}, view_, SE3(), place), RefinementOutcome::kRefined);
  ASSERT_LT(place.inliers, 0.7 * static_cast<double>(refinement.found().size()));
  EXPECT_LE(place.weight, place.inliers);
}

/// One point in ten is the least that is enough, unless it is said otherwise (docs/places.md).
TEST_F(PoseRefinementTest, MostPointsMissingContradictsWithoutBeingAskedFor) {
  make_map(160, 2, 14);
  RefinementOptions options;
  options.min_inliers = 4;
  RefinedPlace place;
  const double share = std::exchange(options.min_visible_share, 0);
  ASSERT_EQ(refine(SE3(), place, options), RefinementOutcome::kRefined);
  ASSERT_LT(place.inliers, 16);
  options.min_visible_share = share;
  EXPECT_EQ(refine(SE3(), place, options), RefinementOutcome::kContradicted);
}

/// A poster in another room: enough points are where they should be, and agree; all the others are missing.
TEST_F(PoseRefinementTest, AFewPointsThatFitDoNotSpeakForThoseThatAreMissing) {
  make_map(160, 2, 6);
  RefinementOptions options;
  options.min_inliers = 10;
  options.min_visible_share = 0;
  RefinedPlace place;
  ASSERT_EQ(refine(SE3(), place, options), RefinementOutcome::kRefined);
  ASSERT_LT(place.inliers, 40);
  options.min_visible_share = 0.3;
  EXPECT_EQ(refine(SE3(), place, options), RefinementOutcome::kContradicted);
}

}  // namespace
}  // namespace twofold
