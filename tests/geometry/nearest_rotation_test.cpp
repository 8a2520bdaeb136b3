#include "geometry/nearest_rotation.hpp"

#include <gtest/gtest.h>

#include <Eigen/LU>
#include <random>

namespace twofold {
namespace {

template <class Matrix>
Matrix random_matrix(std::mt19937& rng) {
  std::normal_distribution<double> normal(0, 1);
  Matrix M;
  for (double& m : M.reshaped()) m = normal(rng);
  return M;
}

Matrix3 random_rotation(std::mt19937& rng) {
  return SO3::exp(random_matrix<Vector3>(rng)).matrix();
}

TEST(NearestRotation, GivesARotationBack) {
  std::mt19937 rng(1);
  for (int i = 0; i < 100; ++i) {
    const Matrix3 R = random_rotation(rng);
    EXPECT_LT((nearest_rotation(Matrix3(3.0 * R)) - R).norm(), 1e-12);
  }
}

/// Nothing is nearer, for matrices of either orientation: a reflection's nearest rotation is not the polar
/// factor.
TEST(NearestRotation, NothingIsNearer) {
  std::mt19937 rng(2);
  int reflections = 0;
  for (int i = 0; i < 200; ++i) {
    const Matrix3 M = random_matrix<Matrix3>(rng);
    if (M.determinant() < 0) ++reflections;
    Vector3 s;
    const Matrix3 R = nearest_rotation(M, &s);
    EXPECT_NEAR(R.determinant(), 1, 1e-12);
    EXPECT_LT((R * R.transpose() - Matrix3::Identity()).norm(), 1e-12);
    EXPECT_TRUE(s[0] >= s[1] && s[1] >= s[2] && s[2] >= 0);
    EXPECT_NEAR(s.squaredNorm(), M.squaredNorm(), 1e-9);
    for (int k = 0; k < 20; ++k) {
      const Matrix3 near = SO3::exp(0.3 * random_matrix<Vector3>(rng)).matrix() * R;
      EXPECT_GE((near - M).norm(), (R - M).norm());
      EXPECT_GE((random_rotation(rng) - M).norm(), (R - M).norm());
    }
  }
  EXPECT_GT(reflections, 50);
}

TEST(NearestRotation, InThePlaneToo) {
  std::mt19937 rng(3);
  for (int i = 0; i < 200; ++i) {
    const Eigen::Matrix2d M = random_matrix<Eigen::Matrix2d>(rng);
    const Eigen::Matrix2d R = nearest_rotation(M);
    EXPECT_NEAR(R.determinant(), 1, 1e-12);
    for (double angle = -3.1; angle < 3.1; angle += 0.1)
      EXPECT_GE((Eigen::Rotation2Dd(angle).toRotationMatrix() * R - M).norm(), (R - M).norm() - 1e-12);
  }
}

}  // namespace
}  // namespace twofold
