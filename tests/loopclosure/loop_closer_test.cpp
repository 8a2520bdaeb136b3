#include "loopclosure/loop_closer.hpp"

#include <gtest/gtest.h>

#include <limits>

#include "tests/loopclosure/turning_camera.hpp"

namespace twofold {
namespace {

using testing::pose;
using testing::RenderedScene;
using testing::vocabulary;

class LoopCloserTest : public testing::TurningCamera {
 protected:
  /// The map has keyframes alone: without its points, poses are as rough as they may be.
  static LoopCloserOptions options() {
    LoopCloserOptions options;
    options.recogniser.near_keyframes = 12;
    options.max_sigma = std::numeric_limits<double>::infinity();
    return options;
  }
};

TEST_F(LoopCloserTest, ClosesTheLoopWhenTheCameraComesBackAndNotBefore) {
  LoopCloser closer(rig_, vocabulary(), options());
  int loops = 0;
  for (int k = 0; k < kTurn + 6; ++k) {
    add_to_map(k);
    const auto loop = closer.step(keyframe(k), graph_);
    if (!loop) continue;
    ++loops;
    EXPECT_GE(k, kTurn - 3);
    EXPECT_EQ(loop->snapshot_version, graph_.version());
    EXPECT_EQ(index(loop->to), static_cast<std::uint32_t>(k));
    const SE3 T_to_from = truth(k) * truth(static_cast<int>(index(loop->from))).inverse();
    // Two steps before the turn is full, 24 degrees apart, the views share little more than half.
    EXPECT_LT((loop->T_to_from * T_to_from.inverse()).log().norm(), k < kTurn - 1 ? 0.1 : 0.03) << k;
  }
  EXPECT_GE(loops, 2);
}

TEST_F(LoopCloserTest, ARoughPoseIsNoLoopWhereTheMapKnowsBetter) {
  LoopCloserOptions exact = options();
  exact.max_sigma = LoopCloserOptions{}.max_sigma;
  LoopCloser closer(rig_, vocabulary(), exact);
  for (int k = 0; k < kTurn + 6; ++k) {
    add_to_map(k);
    EXPECT_FALSE(closer.step(keyframe(k), graph_)) << k;
  }
  const auto place = closer.relocalise(keyframe(kTurn + 4).images, graph_);
  ASSERT_TRUE(place) << "who is lost is glad of it";
  EXPECT_EQ(place->weight, 1);
}

TEST_F(LoopCloserTest, OneLikenessAloneIsNotEnough) {
  LoopCloserOptions strict = options();
  strict.recogniser.consistency = 100;
  LoopCloser closer(rig_, vocabulary(), strict);
  for (int k = 0; k < kTurn + 4; ++k) {
    add_to_map(k);
    EXPECT_FALSE(closer.step(keyframe(k), graph_));
  }
}

TEST_F(LoopCloserTest, NeighboursAreNoLoops) {
  LoopCloserOptions wide = options();
  wide.recogniser.near_keyframes = 1000;  // the whole map is near
  LoopCloser closer(rig_, vocabulary(), wide);
  for (int k = 0; k < kTurn + 4; ++k) {
    add_to_map(k);
    EXPECT_FALSE(closer.step(keyframe(k), graph_));
  }
}

TEST_F(LoopCloserTest, RelocalisesInTheMapAndNotElsewhere) {
  LoopCloser closer(rig_, vocabulary(), options());
  for (int k = 0; k < kTurn; ++k) {
    add_to_map(k);
    (void)closer.step(keyframe(k), graph_);
  }
  for (int i = 0; i < 10; ++i) {
    const SE3 T_c_w = pose(0.6 * i + 0.03, {0.1, 0.05, 0.1});
    RenderedScene scene(rig_, Vector3(3, 2, 4), 1);
    FrameImages images;
    scene.render(T_c_w, 1.5, images);
    const auto found = closer.relocalise(images, graph_);
    ASSERT_TRUE(found) << i;
    const SE3 T_c_w_found = found->T_c_k * graph_.T_k_w(found->keyframe);
    EXPECT_LT((T_c_w_found * T_c_w.inverse()).log().norm(), 0.06) << i;
    RenderedScene elsewhere(rig_, Vector3(3, 2, 4), 100 + static_cast<std::uint32_t>(i));
    elsewhere.render(T_c_w, 1.5, images);
    EXPECT_FALSE(closer.relocalise(images, graph_)) << i;
  }
}

/// The same views a second time, from where the map says, so far away from the first.
TEST_F(LoopCloserTest, IsNotPlacedWhereTwoPlacesLookTheSame) {
  constexpr int kViews = 4;
  const auto relocalised = [this](double away) {
    GraphWriter writer;
    GraphSnapshot graph;
    LoopCloser closer(rig_, vocabulary(), options());
    for (int k = 0; k < 2 * kViews; ++k) {
      KeyframeProposal view = keyframe(k % kViews);
      view.id = KeyframeId{static_cast<std::uint32_t>(k)};
      Keyframe added;
      added.id = view.id;
      added.part = KeyframeId{0};
      added.T_k_w = truth(k % kViews) * SE3(SO3(), Vector3(k < kViews ? 0 : away, 0, 0));
      added.median_depth = 3;
      writer.add_keyframe(added);
      writer.set_reference(added.id);
      graph = writer.publish();
      (void)closer.step(view, graph);
    }
    return closer.relocalise(keyframe(1).images, graph).has_value();
  };
  EXPECT_TRUE(relocalised(0));
  EXPECT_TRUE(relocalised(0.2)) << "drift explains it";
  EXPECT_FALSE(relocalised(40));
}

TEST_F(LoopCloserTest, CulledKeyframesAreForgotten) {
  LoopCloser closer(rig_, vocabulary(), options());
  for (int k = 0; k < 6; ++k) {
    add_to_map(k);
    (void)closer.step(keyframe(k), graph_);
  }
  const KeyframeProposal old = keyframe(1);
  ASSERT_TRUE(closer.relocalise(old.images, graph_));
  for (std::uint32_t k = 0; k < 5; ++k) writer_.cull_keyframe(KeyframeId{k}, KeyframeId{5});
  graph_ = writer_.publish();
  EXPECT_FALSE(closer.relocalise(old.images, graph_)) << "before the places are forgotten";
  add_to_map(6);
  (void)closer.step(keyframe(6), graph_);
  for (std::uint32_t k = 0; k < 5; ++k) EXPECT_EQ(closer.places().find(KeyframeId{k}), nullptr) << k;
  for (std::uint32_t k = 5; k < 7; ++k) EXPECT_NE(closer.places().find(KeyframeId{k}), nullptr) << k;
}

/// Hours in a mapped place: every new keyframe is redundant and culled soon.
TEST_F(LoopCloserTest, EveryPlaceIsFoundAfterHundredsOfThousandsOfKeyframes) {
  constexpr std::uint32_t kBefore = 200'000;
  constexpr int kPlaces = 10, kRounds = 4;
  for (std::uint32_t k = 0; k < kBefore; ++k) writer_.add_culled_keyframe({});
  LoopCloser closer(rig_, vocabulary(), options());
  std::vector<KeyframeProposal> views;
  views.reserve(kPlaces);
  for (int k = 0; k < kPlaces; ++k) views.push_back(keyframe(kTurn / kPlaces * k));
  std::uint32_t next = kBefore;
  const auto add = [&](int view) {
    Keyframe added;
    added.id = KeyframeId{next++};
    added.part = KeyframeId{kBefore};
    added.T_k_w = truth(kTurn / kPlaces * view);
    added.median_depth = 3;
    writer_.add_keyframe(added);
    writer_.set_reference(added.id);
    graph_ = writer_.publish();
    views[static_cast<std::size_t>(view)].id = added.id;
    (void)closer.step(views[static_cast<std::size_t>(view)], graph_);
  };
  for (int view = 0; view < kPlaces; ++view) add(view);
  for (int n = 0; n < kRounds * kPlaces; ++n) {
    add(n % kPlaces);
    if (n > 0) writer_.cull_keyframe(KeyframeId{next - 2}, KeyframeId{kBefore});
  }
  graph_ = writer_.publish();
  std::size_t remembered = 0;
  for (std::uint32_t k = kBefore; k < next; ++k) remembered += closer.places().find(KeyframeId{k}) ? 1 : 0;
  EXPECT_LE(remembered, kPlaces + 3U);
  for (const KeyframeProposal& view : views) EXPECT_TRUE(closer.relocalise(view.images, graph_));
}

/// Two keyframes of a part that was begun after a loss suffice, without any before them that agree, and
/// whatever is near them in the graph.
TEST_F(LoopCloserTest, APartOfItsOwnIsLookedForInTheOlderOne) {
  LoopCloserOptions strict = options();
  strict.recogniser.consistency = 100;
  LoopCloser closer(rig_, vocabulary(), strict);
  for (int k = 0; k < kTurn; ++k) {
    add_to_map(k);
    EXPECT_FALSE(closer.step(keyframe(k), graph_));
  }
  const SE3 T_w_own = SE3(SO3::exp({0, 0.4, 0}), Vector3(3, 1, 2));
  std::vector<LoopConstraint> loops;
  for (int k = kTurn + 4; k < kTurn + 7; ++k) {
    Keyframe added;
    added.id = KeyframeId{static_cast<std::uint32_t>(k)};
    added.part = KeyframeId{kTurn + 4};
    added.T_k_w = truth(k) * T_w_own;
    added.median_depth = 3;
    while (graph_.keyframe_count() < static_cast<std::size_t>(k)) {
      writer_.add_culled_keyframe({});
      graph_ = writer_.publish();
    }
    writer_.add_keyframe(added);
    writer_.set_reference(added.id);
    graph_ = writer_.publish();
    if (const auto loop = closer.step(keyframe(k), graph_)) loops.push_back(*loop);
  }
  ASSERT_FALSE(loops.empty());
  for (const LoopConstraint& loop : loops) {
    const SE3 T_to_from =
        truth(static_cast<int>(index(loop.to))) * truth(static_cast<int>(index(loop.from))).inverse();
    EXPECT_LT((loop.T_to_from * T_to_from.inverse()).log().norm(), 0.03);
    EXPECT_LT(index(loop.from), static_cast<std::uint32_t>(kTurn));
  }
}

/// The map is bent: it has the second round beside the first.
TEST_F(LoopCloserTest, ALoopThatMovesTheMapWaitsForASecondWitness) {
  LoopCloser closer(rig_, vocabulary(), options());
  std::vector<int> closed;
  for (int k = 0; k < kTurn + 6; ++k) {
    add_to_map(k);
    if (k > kTurn / 2) {
      const SE3 drift(SO3::exp({0, 0.1, 0}), Vector3(0.8, 0, 0.5));
      writer_.set_pose(KeyframeId{static_cast<std::uint32_t>(k)}, drift * truth(k));
      graph_ = writer_.publish();
    }
    if (closer.step(keyframe(k), graph_)) closed.push_back(k);
  }
  LoopCloserOptions trusting = options();
  trusting.probation.max_shift = 100;
  trusting.probation.max_angle_deg = 180;
  LoopCloser at_once(rig_, vocabulary(), trusting);
  std::vector<int> seen;
  for (int k = 0; k < kTurn + 6; ++k) {
    if (at_once.step(keyframe(k), graph_)) seen.push_back(k);
  }
  ASSERT_GE(seen.size(), 3U);
  ASSERT_FALSE(closed.empty());
  EXPECT_GT(closed.front(), seen.front()) << "the first one is a witness only";
  EXPECT_LE(closed.front(), seen[2]);
}

TEST(LoopCloserOptions, NameWhatIsWrong) {
  EXPECT_EQ(LoopCloserOptions().invalid_reason(), "");
  const auto reason = [](auto&& spoil) {
    LoopCloserOptions options;
    spoil(options);
    return options.invalid_reason();
  };
  EXPECT_EQ(reason([](auto& o) { o.verification.min_inliers = 3; }),
            "verification.min_inliers must be >= 4, is 3");
  EXPECT_EQ(reason([](auto& o) { o.refinement.min_visible_share = 2; }),
            "refinement.min_visible_share must be in [0, 1], is 2");
  EXPECT_EQ(reason([](auto& o) { o.recogniser.consistency = 0; }),
            "recogniser.consistency must be >= 1, is 0");
  EXPECT_EQ(reason([](auto& o) { o.probation.patience = 0; }), "probation.patience must be >= 1, is 0");
  EXPECT_EQ(reason([](auto& o) { o.place_views = 0; }), "place_views must be >= 1, is 0");
}

}  // namespace
}  // namespace twofold
