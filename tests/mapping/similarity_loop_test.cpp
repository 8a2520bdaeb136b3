#include "mapping/similarity_loop.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "evaluation/evaluation.hpp"
#include "fixtures/rendered_scene.hpp"
#include "tests/mapping/small_graphs.hpp"

namespace twofold {
namespace {

using testing::test_rig;

constexpr std::uint32_t kCount = 48;
constexpr double kGrowth = 0.3 / kCount;  // of the unit's logarithm, from one keyframe to the next
const Rig kRig = test_rig(SensorKind::kMono);

/// Once round a circle, looking outwards.
SE3 truth(std::uint32_t k) {
  const double angle = 2 * std::numbers::pi * k / kCount;
  const SO3 R_w_c = SO3::exp(Vector3(0, angle, 0));
  return SE3(R_w_c, R_w_c * Vector3(0, 0, 3)).inverse();
}

Vector3 true_point(std::uint32_t k) {
  return truth(k).inverse() * Vector3(0.2, -0.1, 2);
}

/// As one camera maps it whose unit shrinks: lengths grow with every step. A point before each keyframe.
GraphWriter drifting_map() {
  GraphWriter writer;
  SE3 T_k_w = truth(0);
  for (std::uint32_t k = 0; k < kCount; ++k) {
    const double unit = std::exp(kGrowth * k);
    if (k > 0) {
      const SE3 T_step = truth(k) * truth(k - 1).inverse();
      T_k_w = SE3(T_step.so3(), unit * T_step.translation()) * T_k_w;
    }
    const KeyframeId id = add_keyframe(writer, T_k_w, 2 * unit);
    if (k > 0) link(writer, KeyframeId{k - 1}, id, 30);
    const Vector3 x_k = truth(k) * true_point(k);
    add_point(writer, kRig, T_k_w.inverse() * (unit * x_k), {id});
  }
  writer.set_reference(KeyframeId{kCount - 1});
  return writer;
}

LoopConstraint loop_of(std::uint32_t from, std::uint32_t to, double scale) {
  const SE3 T = truth(to) * truth(from).inverse();
  return {1, KeyframeId{from}, KeyframeId{to}, SE3(T.so3(), scale * T.translation()), 100, 100, scale};
}

/// Root mean square distance of keyframes or points from the truth, in the best unit.
double error_of(const GraphSnapshot& graph, bool points) {
  std::vector<PosePair> pairs;
  for (std::uint32_t k = 0; k < graph.keyframe_count(); ++k) {
    if (graph.keyframe(KeyframeId{k}).culled()) continue;
    const SE3 T_e_c = graph.T_k_w(KeyframeId{k}).inverse(), T_w_c = truth(k).inverse();
    const Vector3 x_e = points ? graph.position(PointId{k}) : T_e_c.translation();
    const Vector3 x_w = points ? true_point(k) : T_w_c.translation();
    pairs.push_back({k, SE3(T_e_c.so3(), x_e), SE3(T_w_c.so3(), x_w)});
  }
  return evaluate(pairs, {.alignment = Alignment::kSim3})->absolute.rmse;
}

TEST(SimilarityLoop, TakesTheDriftOfTheUnitBackAndPointsAlong) {
  GraphWriter writer = drifting_map();
  const LoopConstraint loop = loop_of(0, kCount - 1, std::exp(kGrowth * (kCount - 1)));
  const double before = error_of(writer.graph(), false), points_before = error_of(writer.graph(), true);
  const SE3 T_to_w = writer.graph().T_k_w(loop.to);
  const auto moved = apply_similarities(writer, close_over_sim3(writer.graph(), loop, kRig, {}));
  ASSERT_EQ(moved.size(), kCount);
  const GraphSnapshot& graph = writer.graph();
  EXPECT_LT(error_of(graph, false), 0.05 * before);
  EXPECT_LT(error_of(graph, true), 0.05 * points_before);
  EXPECT_LT((graph.T_k_w(loop.to) * T_to_w.inverse()).log().norm(), 1e-9) << "who came back is not disturbed";
  EXPECT_NEAR(graph.keyframe(loop.from).median_depth / graph.keyframe(loop.to).median_depth, 1, 0.02);
  for (const KeyframeScaling& keyframe : moved)
    EXPECT_NEAR(std::log(keyframe.factor), kGrowth * (kCount - 1 - index(keyframe.id)), 0.02);
}

TEST(SimilarityLoop, EdgesAndCulledKeyframesAreScaled) {
  GraphWriter writer = drifting_map();
  const KeyframeId a{10}, b{11}, culled{5}, replacement{4};
  const SE3 T_b_a = writer.graph().T_k_w(b) * writer.graph().T_k_w(a).inverse();
  link_marginalised(writer, a, b, 30, T_b_a);
  link(writer, KeyframeId{4}, KeyframeId{6}, 30);
  writer.cull_keyframe(culled, replacement);
  const double between =
      writer.graph().replacement(culled).T_this_replacement.unpacked().translation().norm();
  const auto moved = apply_similarities(
      writer,
      close_over_sim3(writer.graph(), loop_of(0, kCount - 1, std::exp(kGrowth * (kCount - 1))), kRig, {}));
  const GraphSnapshot& graph = writer.graph();
  const auto factor = [&](KeyframeId id) {
    return std::find_if(moved.begin(), moved.end(), [&](const auto& k) { return k.id == id; })->factor;
  };
  const Edge& edge = *find_edge(graph.keyframe(a), b);
  const double expected = std::sqrt(factor(a) * factor(b)) * T_b_a.translation().norm();
  EXPECT_GT(expected, 1.1 * T_b_a.translation().norm());
  EXPECT_NEAR(edge.T_other_this.translation().norm(), expected, 1e-9);
  EXPECT_NEAR(find_edge(graph.keyframe(b), a)->T_other_this.translation().norm(), expected, 1e-9);
  EXPECT_NEAR(graph.replacement(culled).T_this_replacement.unpacked().translation().norm(),
              factor(replacement) * between, 1e-9);
  EXPECT_LT(error_of(graph, true), 0.05) << "the culled keyframe's point among them";
}

/// A part of another unit moves into the world and the unit of the one in which the camera is.
TEST(SimilarityLoop, JoinsAPartOfAnotherUnit) {
  GraphWriter writer;
  const double unit = 2.5;
  const SE3 world = SE3::exp((Vector6() << 1, -2, 0.5, 0.3, -0.2, 0.9).finished());
  for (std::uint32_t k = 0; k < 12; ++k) {
    const bool second = k >= 6;
    const SE3 T = truth(k);
    const SE3 T_k_w = second ? SE3(T.so3(), unit * T.translation()) * world : T;
    const KeyframeId id = add_keyframe(writer, T_k_w, second ? 2 * unit : 2);
    writer.set_part(id, KeyframeId{second ? 6U : 0U});
    add_point(writer, kRig, T_k_w.inverse() * ((second ? unit : 1) * (T * true_point(k))), {id});
    if (k != 0 && k != 6) link(writer, KeyframeId{k - 1}, id, 30);
  }
  writer.set_reference(KeyframeId{11});
  const SE3 T_before = writer.graph().T_k_w(KeyframeId{8});
  const auto moved =
      apply_similarities(writer, close_over_sim3(writer.graph(), loop_of(2, 9, unit), kRig, {}));
  EXPECT_EQ(moved.size(), 6u);
  const GraphSnapshot& graph = writer.graph();
  EXPECT_LT(error_of(graph, false), 1e-9);
  EXPECT_LT(error_of(graph, true), 1e-9);
  EXPECT_EQ(graph.T_k_w(KeyframeId{8}).matrix(), T_before.matrix());
  for (std::uint32_t k = 0; k < 12; ++k) EXPECT_EQ(graph.part(KeyframeId{k}), KeyframeId{6});
}

}  // namespace
}  // namespace twofold
