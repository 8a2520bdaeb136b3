#include "geometry/essential_matrix.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <random>

namespace twofold {
namespace {

struct Pairs {
  SE3 T_b_a;
  std::vector<Vector3> a, b;
};

/// Random points seen from two cameras, noise on the plane z = 1.
Pairs random_pairs(std::mt19937& rng, int n, double noise, bool planar = false) {
  std::uniform_real_distribution<double> unit(-1, 1);
  std::normal_distribution<double> normal;
  Pairs p;
  p.T_b_a = SE3(SO3::exp(0.2 * Vector3(unit(rng), unit(rng), unit(rng))),
                Vector3(unit(rng), unit(rng), 0.3 * unit(rng)).normalized());
  while (static_cast<int>(p.a.size()) < n) {
    const Vector3 x_a(4 * unit(rng), 3 * unit(rng), planar ? 6 : 6 + 3 * unit(rng));
    const Vector3 x_b = p.T_b_a * x_a;
    if (x_b.z() < 0.5) continue;
    const auto noisy = [&](const Vector3& x) {
      return Vector3(x / x.z() + noise * Vector3(normal(rng), normal(rng), 0));
    };
    p.a.push_back(noisy(x_a));
    p.b.push_back(noisy(x_b));
  }
  return p;
}

double up_to_sign(const Matrix3& E, const Matrix3& F) {
  return std::min((E - F).norm(), (E + F).norm());
}

TEST(FivePoint, ContainsTheTrueMatrixAndOnlyEssentialOnes) {
  std::mt19937 rng(21);
  int exact = 0;
  constexpr int kTrials = 500;
  for (int i = 0; i < kTrials; ++i) {
    const Pairs p = random_pairs(rng, 5, 0);
    std::vector<Matrix3> solutions;
    solve_five_point(std::span<const Vector3, 5>(p.a.data(), 5), std::span<const Vector3, 5>(p.b.data(), 5),
                     solutions);
    ASSERT_LE(solutions.size(), 10u);
    double best = 10;
    for (const Matrix3& E : solutions) {
      best = std::min(best, up_to_sign(E, essential_matrix(p.T_b_a)));
      for (int k = 0; k < 5; ++k) EXPECT_LT(std::abs(p.b[k].dot(E * p.a[k])), 1e-5);
    }
    if (best < 1e-6) ++exact;
  }
  EXPECT_GE(exact, kTrials * 99 / 100);  // near-double roots cost digits
}

TEST(FivePoint, WorksForPlanarScenes) {
  std::mt19937 rng(22);
  int exact = 0;
  for (int i = 0; i < 100; ++i) {
    const Pairs p = random_pairs(rng, 5, 0, true);
    std::vector<Matrix3> solutions;
    solve_five_point(std::span<const Vector3, 5>(p.a.data(), 5), std::span<const Vector3, 5>(p.b.data(), 5),
                     solutions);
    for (const Matrix3& E : solutions) {
      if (up_to_sign(E, essential_matrix(p.T_b_a)) < 1e-5) {
        ++exact;
        break;
      }
    }
  }
  EXPECT_GE(exact, 97);
}

/// Without a rotation entries of E are zero: the basis of the null space must not hang on one of them.
TEST(FivePoint, WorksForMotionAlongTheAxesWithoutRotation) {
  std::mt19937 rng(23);
  int exact = 0;
  for (int i = 0; i < 99; ++i) {
    Pairs p = random_pairs(rng, 5, 0);
    p.T_b_a = SE3(SO3(), Vector3::Unit(i % 3));
    for (int k = 0; k < 5; ++k) {
      const Vector3 x_b = p.T_b_a * Vector3((4 + k) * p.a[k]);
      p.b[k] = x_b / x_b.z();
    }
    std::vector<Matrix3> solutions;
    solve_five_point(std::span<const Vector3, 5>(p.a.data(), 5), std::span<const Vector3, 5>(p.b.data(), 5),
                     solutions);
    exact += std::any_of(solutions.begin(), solutions.end(),
                         [&](const Matrix3& E) { return up_to_sign(E, essential_matrix(p.T_b_a)) < 1e-6; });
  }
  EXPECT_GE(exact, 97);
}

TEST(FivePoint, GivesNothingForRepeatedPoints) {
  const std::vector<Vector3> same(5, Vector3(0.1, 0.2, 1));
  std::vector<Matrix3> solutions;
  solve_five_point(std::span<const Vector3, 5>(same.data(), 5), std::span<const Vector3, 5>(same.data(), 5),
                   solutions);
  EXPECT_TRUE(solutions.empty());
}

TEST(SampsonDistance, ApproximatesTheDistanceToTheNearestConsistentPair) {
  std::mt19937 rng(23);
  const Pairs p = random_pairs(rng, 50, 0);
  const Matrix3 E = essential_matrix(p.T_b_a);
  for (std::size_t i = 0; i < p.a.size(); ++i) {
    EXPECT_LT(squared_sampson_distance(E, p.a[i], p.b[i]), 1e-28);
    // Moving b across its epipolar line by h: the pair is nearest when a and b share the correction.
    const Vector2 line = (E * p.a[i]).head<2>();
    const double h = 1e-5;
    Vector3 b = p.b[i];
    b.head<2>() += h * line.normalized();
    const double share =
        line.squaredNorm() / (line.squaredNorm() + (E.transpose() * p.b[i]).head<2>().squaredNorm());
    EXPECT_NEAR(std::sqrt(squared_sampson_distance(E, p.a[i], b)) / (h * std::sqrt(share)), 1, 1e-3);
  }
}

TEST(DecomposeEssential, ChoosesTheMotionWithPointsInFront) {
  std::mt19937 rng(24);
  for (int i = 0; i < 100; ++i) {
    const Pairs p = random_pairs(rng, 20, 0);
    std::vector<int> all(20);
    for (int k = 0; k < 20; ++k) all[k] = k;
    for (const double sign : {1.0, -3.0}) {
      const auto T = decompose_essential(sign * essential_matrix(p.T_b_a), p.a, p.b, all);
      ASSERT_TRUE(T);
      EXPECT_LT((p.T_b_a.inverse() * *T).log().norm(), 1e-7);
    }
  }
}

TEST(RelativePose, SurvivesNoiseAndFortyPerCentOutliers) {
  std::mt19937 rng(25);
  std::uniform_real_distribution<double> unit(-1, 1);
  std::vector<double>
      directions;  // errors [rad]; sideways motion over a shallow scene is hard to tell from turning
  for (int trial = 0; trial < 20; ++trial) {
    Pairs p = random_pairs(rng, 300, 1e-3);
    for (int i = 0; i < 120; ++i) p.b[i] = Vector3(unit(rng), unit(rng), 1);
    const auto found = estimate_relative_pose(p.a, p.b, {.threshold = 3e-3, .max_iterations = 2000});
    ASSERT_TRUE(found);
    EXPECT_LT((found->T_b_a.so3() * p.T_b_a.so3().inverse()).log().norm(), 5e-3);
    directions.push_back(std::acos(std::min(1.0, found->T_b_a.translation().dot(p.T_b_a.translation()))));
    EXPECT_GT(std::count_if(found->inliers.begin(), found->inliers.end(), [](int i) { return i >= 120; }),
              170);
  }
}

TEST(RelativePose, NeedsFivePairs) {
  std::mt19937 rng(26);
  const Pairs p = random_pairs(rng, 4, 0);
  EXPECT_FALSE(estimate_relative_pose(p.a, p.b, {.threshold = 1e-3}));
}

}  // namespace
}  // namespace twofold
