// Where the points of a keyframe come from.
#include "tracking/keyframes/new_points.hpp"

#include <gtest/gtest.h>

#include "fixtures/rendered_scene.hpp"
#include "graph/graph_writer.hpp"
#include "tracking/effort_bounds.hpp"

namespace twofold {
namespace {

using namespace testing;

/// A keyframe and the same view again. The map has the points that were started in the first.
class NewPointsTest : public ::testing::Test {
 protected:
  static constexpr KeyframeId kFirst{0}, kSecond{1};
  static constexpr int kMany = 15;  // points started again, of those that were not found

  explicit NewPointsTest(SensorKind kind = SensorKind::kStereo) : rig_(test_rig(kind, 320, 240)) {
    options_.new_points.max_points = 60;
    RenderedScene(rig_, {3, 2, 5}, 21).render(SE3(), 2, images_);
  }

  NewPoints& new_points() {
    if (!new_points_) new_points_.emplace(rig_, options_, fixed_);
    return *new_points_;
  }
  void map_points_of_first() {
    const int started = new_points().start_first(images_, kFirst, RollingShutter(), immature_);
    EXPECT_EQ(started, static_cast<int>(immature_.points().size()));
    Keyframe keyframe;
    keyframe.id = keyframe.part = kFirst;
    writer_.add_keyframe(keyframe);
    for (std::uint32_t n = 0; n < immature_.points().size(); ++n) {
      const ImmaturePoint& from = immature_.points()[n];
      MapPoint point;
      point.anchor = kFirst;
      point.psi = from.psi;
      point.appearance = std::make_shared<const PointAppearance>(from.appearance);
      writer_.add_point(PointId{n}, point);
      Observation observation = from.anchor_observation;
      observation.point = PointId{n};
      writer_.add_observations(kFirst, std::span(&observation, 1));
    }
    graph_ = writer_.publish();
    immature_.clear_points();
    local_map_.update(graph_, kFirst, immature_, 20);
  }
  /// All are found where they are, but those from `first_lost` on are not searched.
  void find(std::size_t first_lost, bool inlier = true) {
    found_.clear();
    for (std::uint32_t i = 0; i < local_map_.points().size(); ++i) {
      const Vector3 z = rig_.project(local_map_.points()[i].x_ref);
      if (i >= first_lost) {
        found_.candidates.insert(z.head<2>().cast<float>(), i);
        continue;
      }
      found_.matches.push_back({i, {z, 0, 0}});
      found_.observations.push_back(observe_point(rig_, local_map_.points()[i].x_ref, z.cast<float>(), 0));
      found_.observations.back().inlier = inlier;
    }
  }
  /// @return of the points started in the second keyframe, those in the cell of one that the map has
  int start_second(int wanted_matches) {
    EffortBounds bounds = bounds_of(EffortLevel::kEverything, options_);
    bounds.wanted_matches = wanted_matches;
    FrameStep step(frame_, graph_, nullptr, bounds, 0);
    new_points().start(images_, kSecond, local_map_, step, found_, immature_);
    int again = 0;
    for (const ImmaturePoint& point : immature_.points()) {
      EXPECT_EQ(point.anchor, kSecond);
      again += std::any_of(
          local_map_.points().begin(), local_map_.points().end(),
          [&](const TrackedPoint& known) { return (known.appearance->uv - point.appearance.uv).norm() < 1; });
    }
    return again;
  }
  [[nodiscard]] int known() const { return static_cast<int>(local_map_.points().size()); }

  const Rig rig_;
  TrackerOptions options_;
  FrameImages images_;
  Frame frame_;
  GraphWriter writer_;
  GraphSnapshot graph_;
  FixedPixels fixed_{320, 240, {}};
  ImmaturePoints immature_{200, 2};
  LocalMap local_map_{200};
  SearchOutcome found_{rig_, options_.local_map.max_searches};
  std::optional<NewPoints> new_points_;
};

class NewPointsOfDepthTest : public NewPointsTest {
 protected:
  NewPointsOfDepthTest() : NewPointsTest(SensorKind::kRgbd) {}
};

class NewPointsOfOneCameraTest : public NewPointsTest {
 protected:
  NewPointsOfOneCameraTest() : NewPointsTest(SensorKind::kMono) {}
};

TEST_F(NewPointsTest, StartWhereNoneOfThoseKnownWasFound) {
  map_points_of_first();
  ASSERT_GT(known(), 30);
  find(0);
  EXPECT_GT(start_second(1000), kMany) << "nothing was found";
}

TEST_F(NewPointsTest, DoNotStartWhereAPointWasFound) {
  map_points_of_first();
  find(1000);
  EXPECT_EQ(start_second(1000), 0);
}

TEST_F(NewPointsTest, StartWhereWhatWasFoundIsAnOutlier) {
  map_points_of_first();
  find(1000, false);
  EXPECT_GT(start_second(1000), kMany);
}

TEST_F(NewPointsTest, DoNotStartWhereAPointWasNotSearchedBecauseEnoughWereFound) {
  map_points_of_first();
  find(10);
  EXPECT_EQ(start_second(10), 0);
}

TEST_F(NewPointsTest, StartWhereAPointWasNotSearchedAndTooFewWereFound) {
  map_points_of_first();
  find(10);
  EXPECT_GT(start_second(11), kMany);
}

TEST_F(NewPointsOfDepthTest, StartWhereAPointWasNotSearched) {
  map_points_of_first();
  ASSERT_GT(known(), 30);
  find(10);
  EXPECT_GT(start_second(10), kMany);
}

TEST_F(NewPointsOfOneCameraTest, AreSeedsAlone) {
  map_points_of_first();
  EXPECT_EQ(known(), 0);
  EXPECT_FALSE(new_points().has_seeds()) << "left to start_seeds";
  (void)start_second(1000);
  EXPECT_TRUE(immature_.points().empty());
  EXPECT_TRUE(new_points().has_seeds());
  new_points().forget_seeds();
  EXPECT_FALSE(new_points().has_seeds());
}

}  // namespace
}  // namespace twofold
