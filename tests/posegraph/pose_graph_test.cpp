#include "posegraph/pose_graph.hpp"

#include <gtest/gtest.h>

#include <random>

#include "posegraph/pose_graph_error.hpp"
#include "posegraph/pose_graph_initialisation.hpp"
#include "tests/numeric_derivative.hpp"

namespace twofold {
namespace {

/// Poses on a closed loop with odometry along it and chords across, measured with the given noise.
template <class Group>
struct Loop {
  using Tangent = typename Group::Tangent;
  static constexpr int kPoses = 60;

  explicit Loop(double noise, unsigned seed = 1) : rng(seed) {
    const Tangent step = [] {
      Tangent x = Tangent::Constant(0.02);
      x[0] = 0.5;
      x[Group::kDof == 7 ? 5 : Group::kDof - 1] = 2 * M_PI / kPoses;
      if (Group::kDof == 7) x[6] = 0;
      return x;
    }();
    for (int i = 0; i < kPoses; ++i) truth.push_back(i == 0 ? Group() : Group::exp(step) * truth.back());
    for (int i = 0; i < kPoses; ++i) add(i, (i + 1) % kPoses, noise);
    for (int i = 0; i < kPoses; i += 4) add(i, (i + 23) % kPoses, noise);
    graph.poses = truth;
  }

  void add(int i, int j, double noise) {
    Tangent x;
    for (int k = 0; k < Group::kDof; ++k) x[k] = noise * normal(rng);
    typename PoseGraph<Group>::Information information = PoseGraph<Group>::Information::Identity();
    information.diagonal() << Tangent::LinSpaced(1, 3);
    graph.constraints.push_back({i, j, Group::exp(x) * truth[j] * truth[i].inverse(), information});
  }

  /// Random poses near the truth; the origin stays.
  void perturb(double sigma) {
    for (int i = 1; i < kPoses; ++i) {
      Tangent x;
      for (int k = 0; k < Group::kDof; ++k) x[k] = sigma * normal(rng);
      graph.poses[i] = Group::exp(x) * graph.poses[i];
    }
  }

  [[nodiscard]] double distance_from_truth() const {
    double worst = 0;
    for (int i = 0; i < kPoses; ++i) {
      worst = std::max(worst, (graph.poses[i] * truth[i].inverse()).log().norm());
    }
    return worst;
  }

  std::mt19937 rng;
  std::normal_distribution<double> normal;
  std::vector<Group> truth;
  PoseGraph<Group> graph;
};

template <class Group>
class PoseGraphOf : public ::testing::Test {};
using Groups = ::testing::Types<SE2, SE3, Sim3>;
TYPED_TEST_SUITE(PoseGraphOf, Groups);

TYPED_TEST(PoseGraphOf, ErrorJacobiansMatchCentralDifferences) {
  using Tangent = typename TypeParam::Tangent;
  using Jacobian = typename TypeParam::AdjointMatrix;
  const TypeParam E = TypeParam::exp(0.4 * Tangent::LinSpaced(-1, 1.3));
  for (const auto error : {PoseGraphError::kLog, PoseGraphError::kComponents}) {
    const Jacobian numeric = central_difference(
        [&](const Tangent& y) { return Tangent(pose_graph_error(TypeParam(TypeParam::exp(y) * E), error)); },
        Tangent::Zero().eval());
    const Jacobian J = pose_graph_error_jacobian(E, pose_graph_error(E, error), error, CbhOrder::kExact);
    EXPECT_LT((J - numeric).norm(), 1e-8);
  }
}

TYPED_TEST(PoseGraphOf, ErrorsAgreeToFirstOrder) {
  using Tangent = typename TypeParam::Tangent;
  const Tangent x = 1e-4 * Tangent::LinSpaced(-1, 1.3);
  const TypeParam E = TypeParam::exp(x);
  EXPECT_LT((pose_graph_error(E, PoseGraphError::kComponents) - x).norm(), 2e-8);
}

TYPED_TEST(PoseGraphOf, RecoversTheTruthFromExactMeasurements) {
  for (const auto error : {PoseGraphError::kLog, PoseGraphError::kComponents}) {
    Loop<TypeParam> loop(0);
    loop.perturb(0.1);
    PoseGraphSolver<TypeParam> solver;
    const auto summary = solver.solve(loop.graph, {.error = error, .relative_decrease = 1e-12});
    EXPECT_LT(summary.final_cost, 1e-16);
    EXPECT_LT(loop.distance_from_truth(), 1e-8);
  }
}

TYPED_TEST(PoseGraphOf, StopsAtAMinimumOfItsCost) {
  using Tangent = typename TypeParam::Tangent;
  Loop<TypeParam> loop(0.02);
  loop.perturb(0.1);
  PoseGraphSolver<TypeParam> solver;
  const auto summary = solver.solve(loop.graph, {.relative_decrease = 1e-12});
  EXPECT_LT(summary.final_cost, summary.initial_cost);
  EXPECT_DOUBLE_EQ(summary.final_cost, pose_graph_cost(loop.graph, PoseGraphError::kLog));
  for (int i = 1; i < loop.kPoses; i += 7) {
    const TypeParam kept = loop.graph.poses[i];
    const Tangent slope =
        central_difference(
            [&](const Tangent& x) {
              loop.graph.poses[i] = TypeParam::exp(x) * kept;
              return Eigen::Matrix<double, 1, 1>(pose_graph_cost(loop.graph, PoseGraphError::kLog));
            },
            Tangent::Zero().eval(), 1e-5)
            .transpose();
    loop.graph.poses[i] = kept;
    EXPECT_LT(slope.norm(), 1e-5) << i;
  }
}

TYPED_TEST(PoseGraphOf, EveryJacobianOrderReachesTheSameMinimum) {
  // Thesis fig. 5.4: orders two and three converge to the exact minimum; the first comes near it.
  double exact = 0;
  for (const auto order : {CbhOrder::kExact, CbhOrder::kThird, CbhOrder::kSecond, CbhOrder::kFirst}) {
    Loop<TypeParam> loop(0.02);
    loop.perturb(0.05);
    PoseGraphSolver<TypeParam> solver;
    const double cost = solver.solve(loop.graph, {.jacobian = order, .relative_decrease = 1e-10}).final_cost;
    if (order == CbhOrder::kExact) exact = cost;
    EXPECT_NEAR(cost / exact, 1, order == CbhOrder::kFirst ? 1e-2 : 1e-5) << static_cast<int>(order);
  }
}

TYPED_TEST(PoseGraphOf, DampingTakesTheGaugeWithoutAnOrigin) {
  Loop<TypeParam> fixed(0.02), free(0.02);
  fixed.perturb(0.1);
  free.perturb(0.1);
  free.graph.origin = -1;
  PoseGraphSolver<TypeParam> solver;
  const double fixed_cost = solver.solve(fixed.graph, {.relative_decrease = 1e-10}).final_cost;
  const double free_cost = solver.solve(free.graph, {.relative_decrease = 1e-10}).final_cost;
  EXPECT_NEAR(free_cost / fixed_cost, 1, 1e-6);
}

/// Beyond the threshold a constraint pulls with a constant force: the loop gives way in proportion to the
/// threshold, hardly in proportion to the error.
TYPED_TEST(PoseGraphOf, HuberKernelBoundsThePullOfAWrongConstraint) {
  using Tangent = typename TypeParam::Tangent;
  using Information = typename PoseGraph<TypeParam>::Information;
  const auto displacement = [](double error, double huber) {
    Loop<TypeParam> loop(0);
    const TypeParam wrong =
        TypeParam::exp(Tangent::Constant(error)) * loop.truth[40] * loop.truth[3].inverse();
    loop.graph.constraints.push_back({3, 40, wrong, 0.01 * Information::Identity()});
    PoseGraphSolver<TypeParam> solver;
    solver.solve(loop.graph, {.huber = huber, .relative_decrease = 1e-9});
    return loop.distance_from_truth();
  };
  EXPECT_NEAR(displacement(0.4, 1e-3) / displacement(0.4, 5e-4), 2, 0.2);
  EXPECT_NEAR(displacement(0.4, 1e-3) / displacement(0.2, 1e-3), 1, 0.35);
  EXPECT_NEAR(displacement(0.4, 0) / displacement(0.2, 0), 2, 0.5);
  EXPECT_LT(displacement(0.4, 1e-3), 0.2 * displacement(0.4, 0));
}

TYPED_TEST(PoseGraphOf, ReusedSolverRepeatsItsResultBitForBit) {
  Loop<TypeParam> loop(0.02);
  loop.perturb(0.1);
  auto again = loop.graph;
  PoseGraphSolver<TypeParam> solver;
  const auto first = solver.solve(loop.graph, {});
  const auto second = solver.solve(again, {});
  EXPECT_EQ(first.final_cost, second.final_cost);
  EXPECT_EQ(first.iterations, second.iterations);
}

TYPED_TEST(PoseGraphOf, ChainSetsExactPoses) {
  Loop<TypeParam> loop(0);
  loop.graph.poses.assign(loop.kPoses, TypeParam());
  EXPECT_TRUE(chain_constraints(loop.graph));
  EXPECT_LT(loop.distance_from_truth(), 1e-9);
  loop.graph.poses.emplace_back();  // nobody measures this one
  EXPECT_FALSE(chain_constraints(loop.graph));
}

TEST(PoseGraph, DisconnectedPartsKeepTheirCostFinite) {
  PoseGraph<SE3> graph;
  graph.poses.resize(4);
  graph.poses[3].translation() = Vector3(0, 0, 1);
  graph.constraints = {{0, 1, SE3(SO3(), {1, 0, 0})}, {2, 3, SE3(SO3(), {0, 2, 0})}};
  PoseGraphSolver<SE3> solver;
  const auto summary = solver.solve(graph, {.chordal_start = true});
  EXPECT_LT(summary.final_cost, 1e-9);
}

TEST(PoseGraph, NothingToDo) {
  PoseGraph<SE3> graph;
  PoseGraphSolver<SE3> solver;
  EXPECT_EQ(solver.solve(graph, {}).termination, SolverSummary::Termination::kEmptyProblem);
}

template <class Group>
void expect_chordal_recovers() {
  Loop<Group> loop(0);
  loop.graph.poses.assign(loop.kPoses, Group());
  loop.graph.origin = 5;
  loop.graph.poses[5] = loop.truth[5];
  std::vector<std::pair<int, int>> edges;
  for (const auto& c : loop.graph.constraints) edges.emplace_back(c.i, c.j);
  const BlockStructure structure = analyse_blocks(loop.kPoses, edges, Group::kDof);
  PoseGraphPositions<Group> positions(loop.graph, structure);
  loop.graph.poses = chordal_initialisation(loop.graph, structure, positions);
  EXPECT_LT(loop.distance_from_truth(), 1e-8);
}

TEST(ChordalInitialisation, IsExactWithoutNoise) {
  expect_chordal_recovers<SE2>();
  expect_chordal_recovers<SE3>();
}

TEST(PoseGraph, ChordalStartFindsTheMinimumFromNowhere) {
  Loop<SE3> good(0.02), lost(0.02);
  lost.perturb(3);
  PoseGraphSolver<SE3> solver;
  const double best = solver.solve(good.graph, {.relative_decrease = 1e-10}).final_cost;
  EXPECT_NEAR(solver.solve(lost.graph, {.chordal_start = true, .relative_decrease = 1e-10}).final_cost / best,
              1, 1e-6);
}

}  // namespace
}  // namespace twofold
