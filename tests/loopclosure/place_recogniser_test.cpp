#include "loopclosure/place_recogniser.hpp"

#include <gtest/gtest.h>

#include "graph/graph_writer.hpp"

namespace twofold {
namespace {

/// Keyframes along a way, each joined to the next. Number k shows place k, and is in the index.
class PlaceRecogniserTest : public ::testing::Test {
 protected:
  static constexpr double kLikeness = 0.5;  // of two neighbouring views
  static KeyframeId k(std::uint32_t id) { return KeyframeId{id}; }
  /// All views of a place are alike, and no two places are.
  static BagOfWords bag_of(std::uint32_t place) { return {{2 * place, 0.5F}, {2 * place + 1, 0.5F}}; }
  /// Half of it looks like one place, half like another.
  static BagOfWords between(std::uint32_t a, std::uint32_t b) { return {{2 * a, 0.5F}, {2 * b, 0.5F}}; }

  PlaceRecogniserTest() {
    options_.near_keyframes = 6;
    options_.same_place = 2;
    for (std::uint32_t n = 0; n < 30; ++n) add_keyframe(k(0), n > 0);
    publish();
  }
  void add_keyframe(KeyframeId part, bool joined) {
    const auto n = static_cast<std::uint32_t>(writer_.graph().keyframe_count());
    Keyframe keyframe;
    keyframe.id = k(n);
    keyframe.part = part;
    writer_.add_keyframe(keyframe);
    writer_.set_reference(k(n));
    if (!joined) return;
    Edge edge;
    edge.other = k(n - 1);
    edge.weight = 50;
    writer_.set_edge(k(n), edge);
  }
  void publish() { graph_ = writer_.publish(); }
  PlaceRecogniser recogniser() const {
    PlaceRecogniser recogniser(100, options_);
    for (std::uint32_t n = 0; n < graph_.keyframe_count(); ++n) recogniser.add(k(n), bag_of(n));
    return recogniser;
  }
  /// What the camera sees from the newest keyframe on.
  std::vector<KeyframeId> recognise(PlaceRecogniser& recogniser, const BagOfWords& bag,
                                    double likeness = kLikeness) const {
    std::vector<KeyframeId> found;
    for (const PlaceCandidate& candidate : recogniser.recognise(k(29), bag, likeness, graph_))
      found.push_back(candidate.keyframe);
    return found;
  }

  using Ids = std::vector<KeyframeId>;
  RecogniserOptions options_;
  GraphWriter writer_;
  GraphSnapshot graph_;
};

TEST_F(PlaceRecogniserTest, APlaceIsSeenAgainWhenTwoKeyframesInARowSaySo) {
  PlaceRecogniser seen = recogniser();
  EXPECT_EQ(recognise(seen, bag_of(7)), Ids{}) << "one says nothing";
  EXPECT_EQ(recognise(seen, bag_of(8)), Ids{k(8)}) << "next to it";
  EXPECT_EQ(recognise(seen, bag_of(15)), Ids{}) << "elsewhere";
  EXPECT_EQ(recognise(seen, bag_of(7)), Ids{}) << "and back: what came before the last one does not count";
}

TEST_F(PlaceRecogniserTest, PlacesAreOneWhereAnEdgeJoinsThem) {
  const auto second_of = [this](std::uint32_t first, std::uint32_t second) {
    PlaceRecogniser seen = recogniser();
    (void)recognise(seen, bag_of(first));
    return recognise(seen, bag_of(second));
  };
  EXPECT_EQ(second_of(5, 15), Ids{});
  Edge edge;
  edge.other = k(15);
  edge.weight = 20;
  writer_.set_edge(k(5), edge);
  publish();
  EXPECT_EQ(second_of(5, 15), Ids{k(15)});
}

TEST_F(PlaceRecogniserTest, WhatIsNearInTheMapIsNoCandidate) {
  options_.consistency = 1;
  PlaceRecogniser seen = recogniser();
  EXPECT_EQ(recognise(seen, bag_of(24)), Ids{}) << "the newest and five before it are near";
  EXPECT_EQ(recognise(seen, bag_of(23)), Ids{k(23)});
}

TEST_F(PlaceRecogniserTest, ACandidateMustLookAsMuchLikeItAsNeighboursDo) {
  options_.consistency = 1;
  options_.min_score = 0.8;
  PlaceRecogniser seen = recogniser();
  EXPECT_EQ(recognise(seen, between(7, 12), 0.6), (Ids{k(7), k(12)})) << "0.5, and 0.48 are needed";
  EXPECT_EQ(recognise(seen, between(7, 12), 0.65), Ids{});
  EXPECT_EQ(recognise(seen, bag_of(7), options_.min_previous_score), Ids{k(7)});
  EXPECT_EQ(recognise(seen, bag_of(7), 0.9 * options_.min_previous_score), Ids{})
      << "where neighbours hardly look alike, nothing is known";
}

TEST_F(PlaceRecogniserTest, WhatWasCulledIsForgotten) {
  options_.consistency = 1;
  PlaceRecogniser seen = recogniser();
  writer_.cull_keyframe(k(7), k(6));
  publish();
  EXPECT_EQ(recognise(seen, bag_of(7)), Ids{});
  EXPECT_TRUE(seen.query_anywhere(bag_of(7), 5, graph_).empty());
  EXPECT_EQ(seen.keyframe_count(), 30U);
  EXPECT_EQ(seen.forget_culled(graph_), Ids{k(7)});
  EXPECT_EQ(seen.keyframe_count(), 29U);
}

TEST_F(PlaceRecogniserTest, ALostCameraIsLookedForEverywhere) {
  add_keyframe(k(30), false);
  publish();
  PlaceRecogniser seen = recogniser();
  seen.add(k(31), bag_of(30));  // the snapshot does not know it yet
  const auto anywhere = seen.query_anywhere(between(28, 30), 5, graph_);
  ASSERT_EQ(anywhere.size(), 3U) << "what is near, too";
  EXPECT_EQ(anywhere[0].keyframe, k(28));
  EXPECT_EQ(seen.query_anywhere(between(28, 30), 1, graph_).size(), 1U);
}

TEST_F(PlaceRecogniserTest, OtherPartsAreThoseThatTheCameraIsNotIn) {
  add_keyframe(k(30), false);
  publish();
  PlaceRecogniser seen = recogniser();
  const auto others = seen.query_other_parts(k(30), between(28, 30), 5, graph_);
  ASSERT_EQ(others.size(), 1U);
  EXPECT_EQ(others[0].keyframe, k(28));
  EXPECT_EQ(seen.query_other_parts(k(0), between(28, 30), 5, graph_).at(0).keyframe, k(30));
}

}  // namespace
}  // namespace twofold
