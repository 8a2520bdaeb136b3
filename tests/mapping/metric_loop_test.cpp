#include "mapping/metric_loop.hpp"

#include <gtest/gtest.h>

#include <memory>
#include <set>

#include "fixtures/graph_invariants.hpp"
#include "fixtures/simulation.hpp"
#include "mapping/edges.hpp"
#include "mapping/mapper_hook.hpp"
#include "tests/mapping/small_graphs.hpp"

namespace twofold {
namespace {

/// An old keyframe 0 and the reference 2 look at the same points; a chain over 1 joins them, which shares no
/// points with the reference. The reference's pose has drifted.
class MetricLoopTest : public testing::Test {
 protected:
  MetricLoopTest() : rig_(simulation::thesis_rig()) {
    options_.min_covisible = 20;
    T_ref_true_ = SE3::exp((Vector6() << 0.15, -0.05, 0.1, 0.02, -0.03, 0.05).finished());
  }

  void make_graph(const SE3& drift, double min_x = -0.9, double max_x = 0.9, double middle_x = 0.05) {
    writer_ = GraphWriter();
    old_ = add_keyframe(writer_, SE3());
    const KeyframeId middle = add_keyframe(writer_, SE3(SO3(), {middle_x, 0, 0}));
    reference_ = add_keyframe(writer_, drift * T_ref_true_);
    link(writer_, old_, middle, 40);
    link(writer_, middle, reference_, 40);
    std::mt19937 rng(3);
    std::uniform_real_distribution<double> x(min_x, max_x), y(-0.7, 0.7), z(0.9, 1.5);
    x_w_.clear();
    for (int n = 0; n < 120; ++n) {
      x_w_.emplace_back(x(rng), y(rng), z(rng));
      add_point(writer_, rig_, x_w_.back(), {old_});
    }
    select_window();
  }

  void select_window() {
    writer_.set_reference(reference_);
    MapperOptions windows;
    windows.inner_window = 2;
    windows.outer_window = 5;
    SelectionScratch scratch;
    select_double_window(writer_.graph(), windows, scratch, window_);
  }

  /// Finds points where truth has them, as far as the radius reaches; every `wrong`-th at a wrong place.
  MetricLoopReport close(double radius_px = 10, int wrong = 0) {
    int calls = 0;
    const PointSearch search = [&, radius_px](const FrameImages&, PointId id, const MapPoint& point,
                                              const SE3& T_k_a) -> std::optional<PointMatch> {
      PointMatch match;
      match.pixel = rig_.project(T_ref_true_ * x_w_[index(id)]);
      if (wrong > 0 && ++calls % wrong == 0) match.pixel += Vector3(4, -3, 4);
      const Vector2 predicted = rig_.camera.project(T_k_a * from_inverse_depth(point.psi));
      if ((match.pixel.head<2>() - predicted).norm() > radius_px) return std::nullopt;
      return match;
    };
    return MetricLoopCloser(rig_, options_, search).close(writer_, window_, reference_, FrameImages());
  }

  Rig rig_;
  MapperOptions options_;
  GraphWriter writer_;
  DoubleWindow window_;
  KeyframeId old_ = kNoKeyframe, reference_ = kNoKeyframe;
  std::vector<Vector3> x_w_;
  SE3 T_ref_true_;
};

TEST_F(MetricLoopTest, ConnectsTheReferenceWithTheTruePoseInSpiteOfDrift) {
  make_graph(SE3::exp((Vector6() << 0.01, 0.005, -0.01, 0.004, -0.003, 0.002).finished()));
  const MetricLoopReport report = close();
  EXPECT_EQ(report.edges, 1);
  EXPECT_GE(report.agreed, options_.min_covisible);
  const Edge* edge = find_edge(writer_.graph().keyframe(reference_), old_);
  ASSERT_NE(edge, nullptr);
  EXPECT_TRUE(edge->marginalised);
  EXPECT_EQ(edge->weight, report.observations);
  // eq. 6.8: the new constraint does not inherit the drift.
  EXPECT_LT((edge->T_other_this * T_ref_true_).log().norm(), 1e-4);
  EXPECT_EQ(static_cast<int>(writer_.graph().keyframe(reference_).observations->size()), report.observations);
  EXPECT_EQ(broken_invariant(writer_.graph()), "");
  EXPECT_EQ(close().searched, 0) << "what is connected is not searched again";
}

TEST_F(MetricLoopTest, WrongMatchesArePruned) {
  make_graph(SE3());
  const MetricLoopReport report = close(10, 4);
  EXPECT_EQ(report.edges, 1);
  EXPECT_EQ(report.agreed, report.found - report.found / 4);
  for (const Observation& o : *writer_.graph().keyframe(reference_).observations) {
    const Vector3 z = rig_.project(T_ref_true_ * x_w_[index(o.point)]);
    EXPECT_LT((z - o.pixel.cast<double>()).norm(), 0.01);
  }
}

TEST_F(MetricLoopTest, MatchesOnOneSideOfTheImageAreNotEnough) {
  make_graph(SE3(), -0.9, -0.25);
  const MetricLoopReport report = close();
  EXPECT_GE(report.agreed, options_.min_covisible);
  EXPECT_EQ(report.edges, 0);
  EXPECT_EQ(find_edge(writer_.graph().keyframe(reference_), old_), nullptr);
  EXPECT_TRUE(writer_.graph().keyframe(reference_).observations->empty());
  options_.loop.min_half_share = 0;
  EXPECT_EQ(close().edges, 1);
}

TEST_F(MetricLoopTest, DriftBeyondTheSearchRadiusClosesNothing) {
  make_graph(SE3(SO3(), {0.2, 0, 0}));
  const MetricLoopReport report = close();
  EXPECT_GE(report.searched, options_.min_covisible);
  EXPECT_LT(report.found, options_.min_covisible);
  EXPECT_EQ(report.edges, 0);
}

TEST_F(MetricLoopTest, OneCameraTiesTogetherOnlyWhatHasOneUnit) {
  rig_.kind = SensorKind::kMono;
  make_graph(SE3());
  EXPECT_EQ(close().edges, 1);
  constexpr double kFarAway = 3;  // median depths, there and back
  make_graph(SE3(), -0.9, 0.9, kFarAway);
  EXPECT_EQ(close().searched, 0);
  struct KnownUnit : MapperHook {
    [[nodiscard]] bool scale_drifts() const override { return false; }
  };
  options_.hook = std::make_shared<KnownUnit>();
  EXPECT_EQ(close().edges, 1);
  options_.hook = nullptr;
  rig_.kind = SensorKind::kStereo;
  make_graph(SE3(), -0.9, 0.9, kFarAway);
  EXPECT_EQ(close().edges, 1);
}

// The mapper was behind and has inserted another one since.
TEST_F(MetricLoopTest, TheKeyframeNeedNotBeTheNewest) {
  make_graph(SE3());
  const KeyframeId newest = add_keyframe(writer_, T_ref_true_);
  link(writer_, reference_, newest, 40);
  writer_.set_reference(newest);
  const MetricLoopReport report = close();
  EXPECT_EQ(report.edges, 1);
  EXPECT_NE(find_edge(writer_.graph().keyframe(reference_), old_), nullptr);
  EXPECT_EQ(find_edge(writer_.graph().keyframe(newest), old_), nullptr);
}

TEST_F(MetricLoopTest, WorkIsBoundedAndSpread) {
  options_.loop.max_searches = 48;
  make_graph(SE3());
  // 8 x 6 parts of the image: one point of each that has any.
  std::set<std::pair<int, int>> parts;
  for (const Vector3& x_w : x_w_) {
    const Vector2 uv = rig_.camera.project(T_ref_true_ * x_w);
    if (rig_.camera.contains(uv, options_.loop.border_px)) {
      parts.insert({static_cast<int>(uv.x() * 8 / 640), static_cast<int>(uv.y() * 6 / 480)});
    }
  }
  ASSERT_GT(parts.size(), 20U);
  EXPECT_EQ(close().searched, static_cast<int>(parts.size()));
}

/// Two that see the points: one of them enough of them.
TEST_F(MetricLoopTest, OnlyWhoSharesEnoughPointsIsConnected) {
  make_graph(SE3());
  const KeyframeId other = add_keyframe(writer_, SE3(SO3(), {0, 0.05, 0}));
  link(writer_, old_, other, 40);
  for (std::uint32_t p = 0; p < 19; ++p) {
    Observation observation;
    observation.point = PointId{p};
    observation.pixel = rig_.project(writer_.graph().T_k_w(other) * x_w_[p]).cast<float>();
    writer_.add_observations(other, std::span(&observation, 1));
  }
  select_window();
  ASSERT_TRUE(window_.contains(other));
  options_.min_covisible = 20;
  EXPECT_EQ(close().edges, 1);
  EXPECT_EQ(find_edge(writer_.graph().keyframe(reference_), other), nullptr);
}

TEST_F(MetricLoopTest, PointsAtTheImagesBorderAreNotSearched) {
  make_graph(SE3());
  options_.loop.border_px = 230;  // 20 of 480 rows are left
  EXPECT_LT(close().searched, options_.min_covisible);
}

TEST_F(MetricLoopTest, PointsSeenFromAnotherSideAreNotSearched) {
  make_graph(SE3());
  options_.loop.min_view_cosine = std::cos(0.02);
  EXPECT_EQ(close().found, 0);
}

}  // namespace
}  // namespace twofold
