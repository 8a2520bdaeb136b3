#include "bench/experiments/double_window/edge_measurements.hpp"

#include <gtest/gtest.h>

#include <Eigen/Eigenvalues>

#include "bench/experiments/double_window/experimental_mapping.hpp"
#include "estimation/pose_constraint.hpp"
#include "estimation/window_solver.hpp"
#include "fixtures/simulation.hpp"
#include "mapping/mapper.hpp"
#include "tests/mapping/small_graphs.hpp"

namespace twofold::bench {
namespace {

/// Four cameras that see the same sixty points, with noise; points are where they fit best.
class EdgeMeasurementsTest : public testing::Test {
 protected:
  static constexpr std::uint32_t kViews = 4, kPoints = 60;

  EdgeMeasurementsTest() : rig_(simulation::thesis_rig()) {
    std::vector<KeyframeId> all;
    for (std::uint32_t n = 0; n < kViews; ++n) {
      Vector6 pose;
      pose << -0.15 * n, 0.05 * (n % 2), 0.03 * n, 0.02 * n, -0.03 * n, 0.05 * n;
      all.push_back(add_keyframe(writer_, SE3::exp(pose)));
    }
    std::mt19937 rng(3);
    std::uniform_real_distribution<double> uniform(-0.5, 0.5);
    for (std::uint32_t p = 0; p < kPoints; ++p) {
      const double x = uniform(rng), y = uniform(rng), z = 1.3 + 0.5 * uniform(rng);
      add_noisy_point({x, y, z}, all, rng);
    }
    writer_.set_reference(all.back());
    fit_structure();
  }

  static KeyframeId k(std::uint32_t id) { return KeyframeId{id}; }

  void add_noisy_point(const Vector3& x_w, const std::vector<KeyframeId>& observers, std::mt19937& rng) {
    std::normal_distribution<double> noise(0, 0.5);
    const PointId id{static_cast<std::uint32_t>(writer_.graph().point_count())};
    MapPoint point;
    point.anchor = observers.front();
    point.psi = to_inverse_depth(writer_.graph().T_k_w(point.anchor) * x_w);
    writer_.add_point(id, point);
    for (const KeyframeId observer : observers) {
      Observation seen;
      seen.point = id;
      seen.pixel = rig_.project(writer_.graph().T_k_w(observer) * x_w).cast<float>();
      for (int c = 0; c < 3; ++c) seen.pixel[c] += static_cast<float>(noise(rng));
      writer_.add_observations(observer, std::span(&seen, 1));
    }
  }

  void fit_structure() {
    DoubleWindow window;
    window.inner = kViews;
    for (std::uint32_t n = 0; n < kViews; ++n) {
      window.position.set(k(n), static_cast<int>(n));
      window.nodes.push_back({k(n), static_cast<int>(n) - 1});
    }
    WindowBuilder builder(rig_, options_);
    builder.build(writer_.graph(), window);
    ASSERT_EQ(builder.problem().points.size(), kPoints);
    WindowSolverOptions solver;
    solver.max_iterations = 30;
    solver.relative_decrease = 1e-14;
    solver.huber_sigmas = 0;
    optimise_structure(builder.problem(), solver);
    builder.write_back(writer_, window);
  }

  /// Half the squared reprojection error of all points, held where they are, for these poses; each by its
  /// information.
  double point_cost(const std::vector<SE3>& poses) const {
    double cost = 0;
    for (std::uint32_t n = 0; n < kViews; ++n) {
      for (const Observation& seen : *writer_.graph().keyframe(k(n)).observations) {
        const Vector3 z = rig_.project(poses[n] * writer_.graph().position(seen.point));
        const Vector3 r = seen.pixel.cast<double>() - z;
        cost += 0.5 * r.dot(rig_.information(seen.pixel, seen.level).cast<double>().cwiseProduct(r));
      }
    }
    return cost;
  }

  double edge_cost(const EdgeMeasurements& edges,
                   const std::vector<std::pair<std::uint32_t, std::uint32_t>>& pairs,
                   const std::vector<SE3>& poses) const {
    double cost = 0;
    for (const auto& [i, j] : pairs) {
      const auto edge = edges.constraint(writer_.graph(), k(i), k(j), {});
      const Vector6 v = pose_constraint_error(edge->T_to_from, poses[i], poses[j]);
      cost += 0.5 * v.dot(edge->information * v);
    }
    return cost;
  }
  /// With no point in the problem.
  Matrix6 information(const EdgeMeasurements& edges, std::uint32_t from, std::uint32_t to) const {
    return edges.constraint(writer_.graph(), k(from), k(to), {})->information;
  }

  Rig rig_;
  MapperOptions options_;
  GraphWriter writer_;
};

TEST_F(EdgeMeasurementsTest, PassOnWhatThePointsWantOfEachPose) {
  EdgeMeasurements edges(1);
  std::vector<std::pair<std::uint32_t, std::uint32_t>> pairs;
  std::vector<SE3> poses;
  for (std::uint32_t j = 0; j < kViews; ++j) {
    poses.push_back(writer_.graph().T_k_w(k(j)));
    // Half of them the other way round.
    for (std::uint32_t i = 0; i < j; ++i) {
      const auto [from, to] = (i + j) % 2 ? std::pair(i, j) : std::pair(j, i);
      ASSERT_TRUE(edges.measure(writer_.graph(), rig_, k(from), k(to)));
      pairs.push_back({from, to});
    }
  }
  constexpr double kStep = 1e-6;
  for (std::uint32_t n = 0; n < kViews; ++n) {
    Vector6 by_points, by_edges;
    for (int c = 0; c < 6; ++c) {
      auto ahead = poses, back = poses;
      ahead[n] = SE3::exp(kStep * Vector6::Unit(c)) * poses[n];
      back[n] = SE3::exp(-kStep * Vector6::Unit(c)) * poses[n];
      by_points[c] = (point_cost(ahead) - point_cost(back)) / (2 * kStep);
      by_edges[c] = (edge_cost(edges, pairs, ahead) - edge_cost(edges, pairs, back)) / (2 * kStep);
    }
    // Up to the Jacobian of log at v, which is the identity but for terms of v's size: below 2 %.
    EXPECT_GT(by_points.norm(), 100);
    EXPECT_LT((by_points - by_edges).norm(), 0.02 * by_points.norm()) << "keyframe " << n;
  }
}

TEST_F(EdgeMeasurementsTest, CountAPointOnceHoweverManyEdgesShareIt) {
  // With one more keyframe that sees all points, each pair's share goes from 1/4 to 1/5.
  EdgeMeasurements edges(1);
  ASSERT_TRUE(edges.measure(writer_.graph(), rig_, k(0), k(2)));
  const Matrix6 before = information(edges, 0, 2);
  const KeyframeId fifth = add_keyframe(writer_, writer_.graph().T_k_w(k(1)));
  const ObservationList seen = *writer_.graph().keyframe(k(1)).observations;
  writer_.add_observations(fifth, seen);
  const Matrix6 after = information(edges, 0, 2);
  EXPECT_LT((after - 0.8 * before).norm(), 1e-9 * before.norm());
}

TEST_F(EdgeMeasurementsTest, SpeakForPointsOutsideOfTheProblemOnly) {
  EdgeMeasurements edges(1);
  ASSERT_TRUE(edges.measure(writer_.graph(), rig_, k(1), k(3)));
  IdMap position;
  for (std::uint32_t p = 0; p < kPoints; ++p) position.set(PointId{p}, 0);  // looked at and left out
  const Matrix6 full = edges.constraint(writer_.graph(), k(1), k(3), position)->information;
  EXPECT_GT(full.norm(), 0);
  for (std::uint32_t p = 0; p < kPoints / 2; ++p) position.set(PointId{p}, 1);
  const Matrix6 half = edges.constraint(writer_.graph(), k(1), k(3), position)->information;
  EXPECT_LT((half - 0.5 * full).norm(), 1e-9 * full.norm());
  for (std::uint32_t p = 0; p < kPoints; ++p) position.set(PointId{p}, static_cast<int>(p) + 1);
  EXPECT_TRUE(edges.constraint(writer_.graph(), k(1), k(3), position)->information.isZero(0));
}

TEST_F(EdgeMeasurementsTest, KeepAShareOfWhatTheySayAboutLengthAndAllElse) {
  EdgeMeasurements edges(1);
  ASSERT_TRUE(edges.measure(writer_.graph(), rig_, k(0), k(3)));
  EdgeMeasurements soft_edges(0.1);
  ASSERT_TRUE(soft_edges.measure(writer_.graph(), rig_, k(0), k(3)));
  const SE3 T = edges.constraint(writer_.graph(), k(0), k(3), {})->T_to_from;
  EXPECT_EQ(T.translation(), soft_edges.constraint(writer_.graph(), k(0), k(3), {})->T_to_from.translation());
  const Matrix6 stiff = information(edges, 0, 3);
  const Matrix6 soft = information(soft_edges, 0, 3);
  Vector6 longer = Vector6::Zero();
  longer.head<3>() = T.translation();
  EXPECT_NEAR(longer.dot(soft * longer), 0.1 * longer.dot(stiff * longer), 1e-9 * stiff.norm());
  const Eigen::SelfAdjointEigenSolver<Matrix6> difference(stiff - soft), left(soft);
  EXPECT_GT(left.eigenvalues().minCoeff(), 0);
  EXPECT_LT(std::abs(difference.eigenvalues()[4]), 1e-9 * stiff.norm());  // of rank one
}

TEST_F(EdgeMeasurementsTest, AreForgottenWithTheirKeyframeOrForAnotherConstraint) {
  EdgeMeasurements edges(1);
  ASSERT_TRUE(edges.measure(writer_.graph(), rig_, k(0), k(1)));
  ASSERT_TRUE(edges.measure(writer_.graph(), rig_, k(2), k(0)));
  ASSERT_TRUE(edges.measure(writer_.graph(), rig_, k(2), k(3)));
  edges.forget(k(1), k(0));
  EXPECT_FALSE(edges.constraint(writer_.graph(), k(0), k(1), {}));
  EXPECT_TRUE(edges.constraint(writer_.graph(), k(0), k(2), {}));
  edges.forget(k(2));
  EXPECT_FALSE(edges.constraint(writer_.graph(), k(0), k(2), {}));
  EXPECT_FALSE(edges.constraint(writer_.graph(), k(3), k(2), {}));
}

TEST(EdgeMeasurements, AreNotMadeOfTooFewPoints) {
  GraphWriter writer = chain(2);
  const Rig rig = simulation::thesis_rig();
  add_point(writer, rig, {0.1, 0.1, 1.5}, {KeyframeId{0}, KeyframeId{1}});
  EdgeMeasurements edges(0.05);
  EXPECT_FALSE(edges.measure(writer.graph(), rig, KeyframeId{0}, KeyframeId{1}));
  EXPECT_FALSE(edges.constraint(writer.graph(), KeyframeId{0}, KeyframeId{1}, {}));
}

TEST(EdgeMeasurements, KeepAMapThatFitsItsMeasurements) {
  simulation::Simulation simulation = simulation::noise_free_spiral();
  MapperOptions mapper_options;
  mapper_options.inner_window = 8;
  mapper_options.outer_window = 20;
  mapper_options.culling.keyframes = mapper_options.loop.enabled = false;
  mapper_options.hook = std::make_shared<ExperimentalMapping>(
      simulation.rig(), mapper_options, ExperimentalMappingOptions{.measured_edges = true});
  Mapper mapper(simulation.rig(), mapper_options);
  int left = 0;
  while (!simulation.done()) {
    KeyframeProposal* proposal = &simulation.propose(mapper.graph());
    left += mapper.step(std::span(&proposal, 1)).edges_marginalised;
  }
  EXPECT_GT(left, 100);
  double worst = 0;
  for (const TreeNode& node : mapper.window().nodes) {
    const SE3 T = mapper.graph().T_k_w(node.id) * mapper.graph().T_k_w(mapper.graph().reference()).inverse();
    const SE3 T_true =
        simulation.true_pose(node.id) * simulation.true_pose(mapper.graph().reference()).inverse();
    worst = std::max(worst, (T.translation() - T_true.translation()).norm());
  }
  EXPECT_LT(worst, 1e-3);
}

}  // namespace
}  // namespace twofold::bench
