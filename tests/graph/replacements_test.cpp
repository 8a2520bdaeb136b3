#include <gtest/gtest.h>

#include <algorithm>
#include <map>
#include <random>
#include <vector>

#include "fixtures/graph_invariants.hpp"
#include "tests/graph/graph_pieces.hpp"
#include "tests/random_pose.hpp"

namespace twofold {
namespace {

using testing::add_keyframe;
using testing::anchored_in;
using testing::edge_to;
using testing::seen;

TEST(Replacements, CulledKeyframesAndTheirPointsFollowTheirReplacements) {
  std::mt19937 rng(4);
  GraphWriter writer;
  std::vector<KeyframeId> k;
  for (int i = 0; i < 4; ++i) k.push_back(add_keyframe(writer, random_pose(rng)));
  MapPoint point = anchored_in(k[0]);
  point.psi = {0.1, -0.2, 0.5};
  writer.add_point(PointId{0}, point);
  writer.add_observations(k[0], std::vector{seen(0)});
  writer.add_observations(k[2], std::vector{seen(0)});
  for (int i = 0; i < 3; ++i) writer.set_edge(k[0], edge_to(k[static_cast<std::size_t>(i + 1)], 10));
  const SE3 T_0_3 = writer.graph().T_k_w(k[0]) * writer.graph().T_k_w(k[3]).inverse();
  const Vector3 position = writer.graph().position(PointId{0});

  writer.cull_keyframe(k[0], k[1]);
  writer.cull_keyframe(k[1], k[2]);
  writer.cull_keyframe(k[2], k[3]);  // a chain of replacements
  EXPECT_EQ(broken_invariant(writer.graph()), "");
  EXPECT_LT((writer.graph().position(PointId{0}) - position).norm(), 1e-12);

  writer.shorten_replacements(k[0]);
  EXPECT_EQ(writer.graph().replacement(k[0]).id, k[3]);
  writer.shorten_replacements(k[3]);  // nothing to do for one that stayed
  EXPECT_FALSE(writer.graph().keyframe(k[3]).culled());
  EXPECT_EQ(broken_invariant(writer.graph()), "");

  EXPECT_TRUE(writer.graph().keyframe(k[0]).culled());
  EXPECT_EQ(writer.graph().live_replacement(k[1])->id, k[3]);
  EXPECT_EQ(writer.graph().live_replacement(k[3])->id, k[3]);
  EXPECT_EQ(writer.graph().part(k[0]), writer.graph().keyframe(k[3]).part);
  writer.set_part(k[3], k[3]);
  EXPECT_EQ(writer.graph().part(k[0]), k[3]);

  const SE3 T_3_w = random_pose(rng);
  writer.set_pose(k[3], T_3_w);
  EXPECT_LT((writer.graph().T_k_w(k[0]) * (T_0_3 * T_3_w).inverse()).log().norm(), 1e-10);
  EXPECT_DEATH(writer.cull_keyframe(k[3], k[0]), "replacement");
  EXPECT_DEATH(writer.set_edge(k[3], edge_to(k[0], 1)), "culled");
}

TEST(Replacements, OldReplacementsAreForgottenButForThoseThatPointsHangOn) {
  std::mt19937 rng(5);
  GraphWriter writer;
  std::vector<KeyframeId> k;
  for (int i = 0; i < 7; ++i) k.push_back(add_keyframe(writer, random_pose(rng)));
  for (std::uint32_t p = 0; p < 2; ++p) {
    MapPoint point = anchored_in(k[1]);
    point.psi = {0.1, -0.2, 0.5};
    writer.add_point(PointId{p}, point);
  }
  const Vector3 position = writer.graph().position(PointId{0});
  for (std::size_t i = 0; i < 5; ++i) writer.cull_keyframe(k[i], k[i + 1]);
  writer.forget_replacements(2);
  EXPECT_EQ(writer.replacement_count(), 3U);  // k[1] and the newest two
  const GraphSnapshot published = writer.publish();
  for (const std::size_t gone : {0U, 2U}) {
    EXPECT_FALSE(published.live_replacement(k[gone]));
    EXPECT_EQ(published.part(k[gone]), kNoKeyframe);
  }
  for (const std::size_t left : {1U, 3U, 4U}) EXPECT_EQ(published.live_replacement(k[left])->id, k[5]);
  EXPECT_LT((published.position(PointId{0}) - position).norm(), 1e-12);
  EXPECT_EQ(broken_invariant(published), "");

  writer.cull_point(PointId{0});
  writer.forget_replacements(0);
  EXPECT_EQ(writer.replacement_count(), 1U);
  writer.cull_point(PointId{1});  // the last one
  writer.forget_replacements(0);
  EXPECT_EQ(writer.replacement_count(), 0U);
  EXPECT_EQ(broken_invariant(writer.graph()), "");
  EXPECT_EQ(known_replacements(published), 3U) << "a version that was published stays as it is";
  EXPECT_DEATH((void)writer.graph().T_k_w(k[1]), "forgotten");
  EXPECT_DEATH(writer.add_point(PointId{2}, anchored_in(k[1])), "anchor");
}

/// Keyframes and points come and go; keyframes are culled in any order, so that replacements hang on
/// replacements.
TEST(Replacements, PlacesOfPointsSurviveForgetting) {
  constexpr std::size_t kKeep = 15;
  for (unsigned seed = 1; seed <= 5; ++seed) {
    SCOPED_TRACE(seed);
    std::mt19937 rng(seed);
    GraphWriter writer;
    std::vector<KeyframeId> live, culled;
    std::map<std::uint32_t, Vector3> positions;
    std::uint32_t points = 0;
    std::size_t most_anchors = 0;
    for (int step = 0; step < 600; ++step) {
      live.push_back(add_keyframe(writer, random_pose(rng)));
      for (int n = 0; n < 2; ++n, ++points) {
        MapPoint point = anchored_in(live[rng() % live.size()]);
        point.psi = {0.1, -0.2, 0.5};
        writer.add_point(PointId{points}, point);
        positions[points] = writer.graph().position(PointId{points});
        if (positions.size() <= 40) continue;
        const auto gone = std::next(positions.begin(), rng() % positions.size());
        writer.cull_point(PointId{gone->first});
        positions.erase(gone);
      }
      if (live.size() <= 8) continue;
      const auto at = live.begin() + static_cast<std::ptrdiff_t>(rng() % live.size());
      culled.push_back(*at);
      live.erase(at);
      writer.cull_keyframe(culled.back(), live[rng() % live.size()]);
      writer.forget_replacements(kKeep);
      if (step % 10 == 0) {
        ASSERT_EQ(broken_invariant(writer.graph()), "");
      }
      for (std::size_t n = culled.size() - std::min(kKeep, culled.size()); n < culled.size(); ++n) {
        ASSERT_TRUE(writer.graph().live_replacement(culled[n]));
      }
      most_anchors = std::max(most_anchors, culled_anchors(writer.graph()));
      ASSERT_LE(writer.replacement_count(), kKeep + 2 * most_anchors);
      ASSERT_EQ(writer.replacement_count(), known_replacements(writer.graph()));
    }
    for (const auto& [p, position] : positions) {
      ASSERT_LT((writer.graph().position(PointId{p}) - position).norm(), 1e-9 * (1 + position.norm()));
    }
    GraphWriter adopted(writer.publish());
    EXPECT_EQ(adopted.replacement_count(), writer.replacement_count());
    adopted.keep_needed_replacements();
    EXPECT_EQ(adopted.replacement_count(), culled_anchors(adopted.graph()));
    EXPECT_EQ(broken_invariant(adopted.graph()), "");
  }
}

}  // namespace
}  // namespace twofold
