#include "mapping/map_parts.hpp"

#include <gtest/gtest.h>

#include "mapping/mapper.hpp"
#include "mapping/similarity_loop.hpp"
#include "tests/mapping/small_graphs.hpp"

namespace twofold {
namespace {

/// A second part behind the first: keyframes in a row of their own world.
KeyframeId add_part(GraphWriter& writer, std::uint32_t n) {
  const KeyframeId first{static_cast<std::uint32_t>(writer.graph().keyframe_count())};
  for (std::uint32_t k = 0; k < n; ++k) {
    const KeyframeId id = add_keyframe(writer, SE3(SO3(), Vector3(0, -0.2 * k, 0)));
    writer.set_part(id, first);
    if (k > 0) link(writer, KeyframeId{index(id) - 1}, id, 30);
  }
  return first;
}

SE3 relative(const GraphSnapshot& graph, std::uint32_t from, std::uint32_t to) {
  return graph.T_k_w(KeyframeId{to}) * graph.T_k_w(KeyframeId{from}).inverse();
}

const SE3 kConstraint = SE3::exp((Vector6() << 1, -2, 0.5, 0.3, -0.2, 0.9).finished());

TEST(MapParts, TheSmallerPartMovesAsAWhole) {
  for (const auto& [old_size, new_size] : {std::pair{6U, 3U}, {3U, 6U}, {4U, 4U}}) {
    GraphWriter writer = chain(old_size);
    const KeyframeId first = add_part(writer, new_size);
    const GraphSnapshot before = writer.graph();
    const KeyframeId from{index(first) + 1}, to{2};
    const bool new_part_moves = new_size <= old_size;
    EXPECT_EQ(join_parts(writer, from, to, kConstraint),
              static_cast<int>(new_part_moves ? new_size : old_size));
    const GraphSnapshot& graph = writer.graph();
    EXPECT_LT((relative(graph, index(from), index(to)) * kConstraint.inverse()).log().norm(), 1e-12);
    for (std::uint32_t k = 0; k < graph.keyframe_count(); ++k) {
      EXPECT_EQ(graph.keyframe(KeyframeId{k}).part, new_part_moves ? KeyframeId{0} : first);
      const bool in_new = KeyframeId{k} >= first;
      if (in_new != new_part_moves) {
        EXPECT_EQ(graph.T_k_w(KeyframeId{k}).matrix(), before.T_k_w(KeyframeId{k}).matrix());
      }
      const std::uint32_t root = in_new ? index(first) : 0;
      EXPECT_LT((relative(graph, root, k) * relative(before, root, k).inverse()).log().norm(), 1e-12);
    }
  }
}

TEST(MapParts, OfTwoAlikeTheYoungerMovesWhicheverTheLoopComesFrom) {
  for (const bool from_older : {true, false}) {
    GraphWriter writer = chain(4);
    const KeyframeId older{1}, younger{index(add_part(writer, 4)) + 1};
    const SE3 before = writer.graph().T_k_w(older);
    if (from_older) {
      join_parts(writer, older, younger, kConstraint);
    } else {
      join_parts(writer, younger, older, kConstraint);
    }
    EXPECT_EQ(writer.graph().T_k_w(older).matrix(), before.matrix()) << from_older;
    EXPECT_EQ(writer.graph().part(younger), KeyframeId{0}) << from_older;
  }
}

TEST(MapParts, KeyframesOfOnePartStay) {
  GraphWriter writer = chain(5);
  EXPECT_EQ(join_parts(writer, KeyframeId{0}, KeyframeId{4}, kConstraint), 0);
  EXPECT_NEAR(relative(writer.graph(), 0, 4).translation().x(), -0.4, 1e-12);
}

TEST(MapParts, CulledKeyframesGoAlong) {
  GraphWriter writer = chain(6);
  const KeyframeId first = add_part(writer, 4);
  const KeyframeId culled{index(first) + 1}, replacement{index(first) + 2};
  const GraphSnapshot before = writer.graph();
  writer.cull_keyframe(culled, replacement);
  EXPECT_EQ(join_parts(writer, replacement, KeyframeId{0}, kConstraint), 3);
  EXPECT_EQ(writer.graph().part(culled), KeyframeId{0});
  const std::uint32_t a = index(culled), b = index(replacement);
  EXPECT_LT((relative(writer.graph(), a, b) * relative(before, a, b).inverse()).log().norm(), 1e-12);
}

TEST(MapParts, AProposalWithoutReferenceStartsOneAndALoopJoinsIt) {
  Rig rig;
  rig.baseline = 0.1;
  Mapper mapper(rig, {});
  mapper.continue_from(chain(5).publish());
  KeyframeProposal first, second;
  first.id = KeyframeId{5};
  first.median_depth = second.median_depth = 1;
  second.id = KeyframeId{6};
  second.reference = KeyframeId{5};
  second.T_k_ref = SE3(SO3(), Vector3(0.1, 0, 0));
  for (KeyframeProposal* proposal : {&first, &second}) mapper.step(std::span(&proposal, 1));
  EXPECT_EQ(mapper.graph().keyframe(KeyframeId{4}).part, KeyframeId{0});
  EXPECT_EQ(mapper.graph().keyframe(KeyframeId{5}).part, KeyframeId{5});
  EXPECT_EQ(mapper.graph().keyframe(KeyframeId{6}).part, KeyframeId{5});

  LoopConstraint loop;
  loop.from = KeyframeId{6};
  loop.to = KeyframeId{1};
  loop.T_to_from = kConstraint;
  loop.weight = 40;
  const MapperReport report = mapper.step({}, std::span(&loop, 1));
  EXPECT_EQ(report.joined, 2);
  EXPECT_EQ(mapper.graph().last_change().kind, MapChange::Kind::kPartsJoined);
  for (std::uint32_t k = 0; k < 7; ++k) EXPECT_EQ(mapper.graph().keyframe(KeyframeId{k}).part, KeyframeId{0});
  EXPECT_LT((relative(mapper.graph(), 6, 1) * kConstraint.inverse()).log().norm(), 1e-9);
  EXPECT_NE(find_edge(mapper.graph().keyframe(KeyframeId{6}), KeyframeId{1}), nullptr);
}

/// Its other part has moved into the camera's before the loop is added.
TEST(MapParts, ThoseOfOneCameraAreSaidToBeJoined) {
  Rig rig;
  rig.kind = SensorKind::kMono;
  rig.camera = {420, 420, 320, 240, 640, 480};
  GraphWriter writer = chain(5);
  const KeyframeId cameras = add_part(writer, 2);
  writer.set_reference(KeyframeId{6});
  Mapper mapper(rig, {});
  mapper.continue_from(writer.publish());
  const auto close = [&](std::uint32_t from, std::uint32_t to) {
    LoopConstraint loop;
    loop.from = KeyframeId{from};
    loop.to = KeyframeId{to};
    loop.weight = 40;
    loop.scale = 0.5;
    loop.T_to_from = kConstraint;
    (void)mapper.take_similarities(close_over_sim3(mapper.graph(), loop, rig, mapper.options()));
    return mapper.step({}, std::span(&loop, 1));
  };
  EXPECT_EQ(close(2, 6).joined, 5);
  EXPECT_EQ(mapper.graph().last_change().kind, MapChange::Kind::kPartsJoined);
  EXPECT_EQ(mapper.graph().part(KeyframeId{0}), cameras);
  EXPECT_EQ(mapper.step({}).joined, 0);
  EXPECT_EQ(close(0, 6).joined, 0);
  EXPECT_EQ(mapper.graph().last_change().kind, MapChange::Kind::kLoopClosure);
}

}  // namespace
}  // namespace twofold
