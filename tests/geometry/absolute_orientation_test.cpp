#include "geometry/absolute_orientation.hpp"

#include <gtest/gtest.h>

#include <random>
#include <span>
#include <utility>
#include <vector>

namespace twofold {
namespace {

class AbsoluteOrientation : public ::testing::Test {
 protected:
  Vector3 random() { return {normal_(rng_), normal_(rng_), normal_(rng_)}; }
  std::vector<Vector3> cloud(int n) {
    std::vector<Vector3> x(n);
    for (auto& p : x) p = random();
    return x;
  }
  template <class Transform>
  std::vector<Vector3> moved(const Transform& T, const std::vector<Vector3>& x, double noise = 0) {
    std::vector<Vector3> y;
    for (const auto& p : x) y.push_back(T * p + noise * random());
    return y;
  }
  std::mt19937 rng_{9};
  std::normal_distribution<double> normal_;
};

TEST_F(AbsoluteOrientation, RecoversExactMotions) {
  for (int n : {3, 4, 10, 100}) {
    for (int i = 0; i < 50; ++i) {
      const SE3 T(SO3::exp(2 * random()), 5 * random());
      const auto x_b = cloud(n);
      const auto found = align_rigid(moved(T, x_b), x_b);
      ASSERT_TRUE(found);
      EXPECT_LT((T.inverse() * *found).log().norm(), 1e-8);
      const Sim3 S(std::exp(normal_(rng_)), T.so3(), T.translation());
      const auto found_sim = align_similarity(moved(S, x_b), x_b);
      ASSERT_TRUE(found_sim);
      EXPECT_LT((S.inverse() * *found_sim).log().norm(), 1e-8);
    }
  }
}

// Three points have a solution of their own, in closed form.
TEST_F(AbsoluteOrientation, MinimisesTheSquaredDistance) {
  for (const auto& [points, noise] : {std::pair{30, 0.1}, {3, 0.1}, {3, 0.7}}) {
    const SE3 T(SO3::exp(random()), random());
    const auto x_b = cloud(points);
    const auto x_a = moved(T, x_b, noise);
    const auto found = align_rigid(x_a, x_b);
    ASSERT_TRUE(found);
    const auto cost = [&](const SE3& T_a_b) {
      double sum = 0;
      for (std::size_t i = 0; i < x_a.size(); ++i) sum += (x_a[i] - T_a_b * x_b[i]).squaredNorm();
      return sum;
    };
    for (int k = 0; k < 6; ++k) {
      for (const double h : {1e-4, -1e-4, 0.5, -0.5})
        EXPECT_GT(cost(SE3::exp(h * Vector6::Unit(k)) * *found), cost(*found)) << points << " points";
    }
  }
}

TEST_F(AbsoluteOrientation, ErrorFallsWithTheSquareRootOfTheNumberOfPoints) {
  const Sim3 S(1.3, SO3::exp(random()), random());
  const auto mean_error = [&](int n) {
    double sum = 0;
    for (int i = 0; i < 200; ++i) {
      const auto x_b = cloud(n);
      sum += (S.inverse() * *align_similarity(moved(S, x_b, 0.05), x_b)).log().norm();
    }
    return sum / 200;
  };
  EXPECT_NEAR(mean_error(25) / mean_error(400), 4.0, 0.8);
}

TEST_F(AbsoluteOrientation, NeverReturnsAReflection) {
  // Planar points fit their mirror image as well; strong noise makes the mirror fit better half of the time.
  for (int i = 0; i < 200; ++i) {
    auto x_b = cloud(4);
    for (auto& p : x_b) p.z() *= 0.01;
    const auto x_a = moved(SE3(), x_b, 0.2);
    const auto found = align_rigid(x_a, x_b);
    ASSERT_TRUE(found);
    EXPECT_NEAR(found->rotation().determinant(), 1, 1e-12);
  }
  // An exact mirror image has no exact rotation; the result must still be one.
  const auto x_b = cloud(20);
  auto x_a = x_b;
  for (auto& p : x_a) p.x() = -p.x();
  EXPECT_NEAR(align_rigid(x_a, x_b)->rotation().determinant(), 1, 1e-12);
}

TEST_F(AbsoluteOrientation, ScaleTreatsBothFramesAlike) {
  const auto x_b = cloud(10);
  const auto x_a = moved(Sim3(2, SO3::exp(random()), random()), x_b, 0.3);
  const auto S_a_b = align_similarity(x_a, x_b);
  const auto S_b_a = align_similarity(x_b, x_a);
  ASSERT_TRUE(S_a_b && S_b_a);
  EXPECT_LT((*S_a_b * *S_b_a).log().norm(), 1e-12);
}

TEST_F(AbsoluteOrientation, RejectsDegenerateInput) {
  const auto two = cloud(2);
  EXPECT_FALSE(align_rigid(two, two));
  const auto three = cloud(3);
  EXPECT_FALSE(align_rigid(three, two));
  std::vector<Vector3> line;
  for (int i = 0; i < 10; ++i) line.push_back(Vector3(1, 2, 3) * i);
  EXPECT_FALSE(align_rigid(line, line));
  EXPECT_FALSE(align_rigid(std::span(line).first(3), three));
  EXPECT_FALSE(align_rigid(three, std::span(line).first(3)));
  const std::vector<Vector3> same(5, Vector3(1, 1, 1));
  EXPECT_FALSE(align_rigid(std::span(same).first(3), three));
  EXPECT_FALSE(align_similarity(same, same));
}

}  // namespace
}  // namespace twofold
