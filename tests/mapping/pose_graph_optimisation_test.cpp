#include "mapping/pose_graph_optimisation.hpp"

#include <gtest/gtest.h>

#include "fixtures/graph_invariants.hpp"
#include "fixtures/simulation.hpp"
#include "tests/mapping/small_graphs.hpp"

namespace twofold {
namespace {

/// Keyframes on a circle with true relative poses as constraints and absolute poses that do not agree.
GraphWriter drifted_ring(std::uint32_t count, const std::vector<SE3>& truth, std::uint32_t first) {
  GraphWriter writer;
  for (std::uint32_t n = 0; n < first + count; ++n) add_keyframe(writer, truth[n]);
  for (std::uint32_t part = 0; part < 2; ++part) {
    const std::uint32_t begin = part == 0 ? 0 : first, end = part == 0 ? first : first + count;
    for (std::uint32_t n = begin; n < end; ++n) {
      const std::uint32_t next = n + 1 < end ? n + 1 : begin;
      if (next == n) continue;
      link_marginalised(writer, KeyframeId{n}, KeyframeId{next}, 30, truth[next] * truth[n].inverse());
    }
  }
  std::mt19937 rng(4);
  std::normal_distribution<double> noise(0, 0.1);
  for (std::uint32_t n = 0; n < first + count; ++n) {
    Vector6 v;
    for (int i = 0; i < 6; ++i) v[i] = noise(rng);
    writer.set_pose(KeyframeId{n}, SE3::exp(v) * truth[n]);
  }
  return writer;
}

TEST(RelaxAllPoses, MakesEveryPartAgreeWithItsEdgesAndKeepsItsRoot) {
  const std::vector<SE3> truth = simulation::circle_path(50, 1, 2, 1);
  GraphWriter writer = drifted_ring(30, truth, 20);
  writer.set_reference(KeyframeId{33});
  const SE3 T_ref_w = writer.graph().T_k_w(KeyframeId{33});
  const SE3 T_0_w = writer.graph().T_k_w(KeyframeId{0});
  const PoseGraphReport report = optimise_all_components(writer, simulation::thesis_rig(), {});
  EXPECT_EQ(report.components, 2);
  EXPECT_EQ(report.keyframes, 50);
  EXPECT_EQ(report.constraints, 50);
  EXPECT_LT((writer.graph().T_k_w(KeyframeId{33}) * T_ref_w.inverse()).log().norm(), 1e-12);
  EXPECT_LT((writer.graph().T_k_w(KeyframeId{0}) * T_0_w.inverse()).log().norm(), 1e-12);
  for (std::uint32_t n = 0; n < 50; ++n) {
    for (const Edge& edge : *writer.graph().keyframe(KeyframeId{n}).edges) {
      const SE3 T = writer.graph().T_k_w(edge.other) * writer.graph().T_k_w(KeyframeId{n}).inverse();
      EXPECT_LT((edge.T_other_this * T.inverse()).log().norm(), 1e-6);
    }
  }
  EXPECT_EQ(broken_invariant(writer.graph()), "");
}

/// The error of a long loop is spread over it.
TEST(RelaxAllPoses, SpreadsTheErrorOfALoop) {
  constexpr std::uint32_t kCount = 60;
  const std::vector<SE3> truth = simulation::circle_path(kCount, 1, 3, 1);
  GraphWriter writer;
  for (const SE3& T : truth) add_keyframe(writer, T);
  const SE3 drift = SE3::exp((Vector6() << 0.01, 0, 0, 0, 0, 0.002).finished());
  for (std::uint32_t n = 0; n < kCount; ++n) {
    const std::uint32_t next = (n + 1) % kCount;
    const SE3 T_next_n = truth[next] * truth[n].inverse();
    link_marginalised(writer, KeyframeId{n}, KeyframeId{next}, 30, next == 0 ? T_next_n : drift * T_next_n);
  }
  writer.set_reference(KeyframeId{0});
  const PoseGraphReport report = optimise_all_components(writer, simulation::thesis_rig(), {});
  EXPECT_LT(report.final_cost, 0.2 * report.initial_cost);
  double largest = 0, sum = 0;
  for (std::uint32_t n = 0; n < kCount; ++n) {
    const Edge& edge = *find_edge(writer.graph().keyframe(KeyframeId{n}), KeyframeId{(n + 1) % kCount});
    const SE3 T = writer.graph().T_k_w(edge.other) * writer.graph().T_k_w(KeyframeId{n}).inverse();
    const double residual = (edge.T_other_this * T.inverse()).log().norm();
    largest = std::max(largest, residual);
    sum += residual;
  }
  EXPECT_LT(largest, 3 * sum / kCount);
}

}  // namespace
}  // namespace twofold
