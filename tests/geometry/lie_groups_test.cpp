#include <gtest/gtest.h>

#include <Eigen/LU>
#include <random>
#include <unsupported/Eigen/MatrixFunctions>

#include "geometry/inverse_depth.hpp"
#include "geometry/se2.hpp"
#include "geometry/sim3.hpp"
#include "geometry/small_motion.hpp"
#include "tests/numeric_derivative.hpp"

namespace twofold {
namespace {

/// Matrix of the Lie algebra, straight from the generators (thesis A.1, 2.45).
Eigen::Matrix3d algebra(const SO3*, const Vector3& x) {
  return hat(x);
}
Eigen::Matrix3d algebra(const SE2*, const Vector3& x) {
  Eigen::Matrix3d m;
  m << 0, -x.z(), x.x(), x.z(), 0, x.y(), 0, 0, 0;
  return m;
}
Matrix4 algebra(const SE3*, const Vector6& x) {
  Matrix4 m = Matrix4::Zero();
  m.topLeftCorner<3, 3>() = hat(x.tail<3>());
  m.topRightCorner<3, 1>() = x.head<3>();
  return m;
}
Matrix4 algebra(const Sim3*, const Vector7& x) {
  Matrix4 m = Matrix4::Zero();
  m.topLeftCorner<3, 3>() = hat(x.segment<3>(3)) + x[6] * Matrix3::Identity();
  m.topRightCorner<3, 1>() = x.head<3>();
  return m;
}

Eigen::Matrix3d matrix(const SO3& R) {
  return R.matrix();
}
Matrix4 matrix(const SE3& T) {
  return T.matrix();
}
Matrix4 matrix(const Sim3& S) {
  return S.matrix();
}
Eigen::Matrix3d matrix(const SE2& T) {
  Eigen::Matrix3d m = Eigen::Matrix3d::Identity();
  m.topLeftCorner<2, 2>() = T.rotation();
  m.topRightCorner<2, 1>() = T.translation();
  return m;
}

void set_rotation(const SO3*, Vector3& x, const Vector3& w) {
  x = w;
}
void set_rotation(const SE2*, Vector3& x, const Vector3& w) {
  x.z() = w.norm() * (w.x() > 0 ? 1 : -1);
}
void set_rotation(const SE3*, Vector6& x, const Vector3& w) {
  x.tail<3>() = w;
}
void set_rotation(const Sim3*, Vector7& x, const Vector3& w) {
  x.segment<3>(3) = w;
}
void set_log_scale(const SO3*, Vector3&, double) {}
void set_log_scale(const SE2*, Vector3&, double) {}
void set_log_scale(const SE3*, Vector6&, double) {}
void set_log_scale(const Sim3*, Vector7& x, double sigma) {
  x[6] = sigma;
}

template <class Group>
class LieGroup : public ::testing::Test {
 protected:
  using Tangent = typename Group::Tangent;
  static constexpr const Group* kTag = nullptr;

  /// Random tangent vectors whose rotation angle and log scale cover the limits of the closed forms.
  template <class Visit>
  void for_tangents(Visit&& visit) {
    std::mt19937 rng(11);
    std::normal_distribution<double> normal;
    for (const double angle : {0.0, 1e-300, 1e-12, 1e-8, 1e-5, 9.9e-5, 1.1e-4, 9.9e-4, 1.1e-3, 9e-3, 1.1e-2,
                               0.3, 0.499, 0.501, 1.0, 2.0, 3.0, M_PI - 1e-3, M_PI - 1e-8}) {
      for (const double sigma : {0.0, 1e-300, 1e-10, -1e-6, 1e-3, -0.1, 0.7, -3.0, 3.0}) {
        for (int i = 0; i < 3; ++i) {
          Tangent x;
          for (int k = 0; k < Group::kDof; ++k) x[k] = normal(rng);
          set_rotation(kTag, x, angle * Vector3(normal(rng), normal(rng), normal(rng)).normalized());
          set_log_scale(kTag, x, sigma);
          visit(x);
        }
      }
    }
  }
};

using Groups = ::testing::Types<SO3, SE2, SE3, Sim3>;
TYPED_TEST_SUITE(LieGroup, Groups);

TYPED_TEST(LieGroup, ExpIsTheMatrixExponential) {
  this->for_tangents([&](const auto& x) {
    const auto m = matrix(TypeParam::exp(x));
    const auto expected = algebra(this->kTag, x).exp().eval();
    EXPECT_LT((m - expected).norm(), 1e-13 * (1 + expected.norm())) << x.transpose();
  });
}

TYPED_TEST(LieGroup, LogInvertsExp) {
  this->for_tangents([&](const auto& x) {
    const auto back = TypeParam::exp(x).log();
    EXPECT_LT((back - x).norm(), 1e-12 * (1 + x.norm())) << x.transpose();
  });
}

TYPED_TEST(LieGroup, LogKeepsSmallRotationsRelativeAccuracy) {
  typename TypeParam::Tangent x = TypeParam::Tangent::Zero();
  set_rotation(this->kTag, x, Vector3(1e-9, 0, 0));
  EXPECT_LT((TypeParam::exp(x).log() - x).norm(), 1e-24);
}

TYPED_TEST(LieGroup, ExpInvertsLogAtHalfTurn) {
  typename TypeParam::Tangent x = TypeParam::Tangent::Constant(0.3);
  set_rotation(this->kTag, x, M_PI * Vector3(0.6, 0, 0.8));
  const TypeParam T = TypeParam::exp(x);
  const TypeParam back = TypeParam::exp(T.log());
  EXPECT_LT((matrix(back) - matrix(T)).norm(), 1e-12);
}

TYPED_TEST(LieGroup, AdjointMovesAPerturbationThroughTheElement) {
  this->for_tangents([&](const auto& x) {
    const TypeParam T = TypeParam::exp(x);
    typename TypeParam::Tangent y = 0.1 * TypeParam::Tangent::LinSpaced(-1, 1.5);
    const auto left = matrix(T * TypeParam::exp(y) * T.inverse());
    const auto right = matrix(TypeParam::exp(T.adjoint() * y));
    EXPECT_LT((left - right).norm(), 1e-11 * (1 + right.norm())) << x.transpose();
  });
}

TYPED_TEST(LieGroup, ProductAndInverseAreThoseOfTheMatrices) {
  this->for_tangents([&](const auto& x) {
    const TypeParam A = TypeParam::exp(x);
    const TypeParam B = TypeParam::exp(0.5 * TypeParam::Tangent::LinSpaced(1, -2));
    EXPECT_LT((matrix(A * B) - matrix(A) * matrix(B)).norm(), 1e-12 * (1 + matrix(A).norm()));
    EXPECT_LT((matrix(A.inverse()) * matrix(A) - matrix(TypeParam())).norm(), 1e-12 * (1 + matrix(A).norm()));
  });
}

TYPED_TEST(LieGroup, LongProductsStayInTheGroup) {
  const TypeParam step = TypeParam::exp([&] {
    typename TypeParam::Tangent x = 0.01 * TypeParam::Tangent::LinSpaced(-1, 2);
    set_log_scale(this->kTag, x, 0);
    return x;
  }());
  TypeParam T;
  for (int i = 0; i < 1000000; ++i) T = T * step;
  EXPECT_NEAR(matrix(T).determinant(), 1.0, 1e-12);
}

TEST(SmallMotion, IsTheExponentialTimesAPoint) {
  std::mt19937 rng(8);
  std::uniform_real_distribution<double> uniform(-1, 1);
  for (const double angle : {0.0, 1e-6, 0.02, 0.1, 0.5}) {
    for (int i = 0; i < 50; ++i) {
      const Vector3 axis = Vector3::NullaryExpr([&] { return uniform(rng); }).normalized();
      Vector6 xi;
      xi << 0.3 * Vector3::NullaryExpr([&] { return uniform(rng); }), angle * axis;
      const Vector3 x = 5 * Vector3::NullaryExpr([&] { return uniform(rng); });
      const double error = (moved_by(xi, x) - SE3::exp(xi) * x).norm();
      EXPECT_LT(error, angle <= 0.1 ? 1e-9 : 2e-5) << angle;
    }
  }
}

TEST(Sim3, WithoutScaleKeepsCentreAndRays) {
  const Sim3 S(2.5, SO3::exp({0.3, -0.2, 0.9}), {1, -2, 3});
  const SE3 T = S.without_scale();
  const Vector3 centre = S.inverse().translation();
  EXPECT_LT((T.inverse().translation() - centre).norm(), 1e-14);
  const Vector3 x(4, 5, 6);
  EXPECT_LT((S * x).normalized().cross((T * x).normalized()).norm(), 1e-14);
}

TEST(InverseDepth, JacobianMatchesCentralDifferenceAndMapsInvert) {
  const SE3 T = SE3::exp((Vector6() << 1, 2, -1, 0.3, -0.4, 0.5).finished());
  const Vector3 psi(0.3, -0.2, 0.4);
  const Matrix3 J =
      central_difference([&](const Vector3& p) { return Vector3(T * from_inverse_depth(p)); }, psi);
  EXPECT_LT((inverse_depth_jacobian(T.rotation(), psi) - J).norm(), 1e-7);
  EXPECT_LT((to_inverse_depth(from_inverse_depth(psi)) - psi).norm(), 1e-15);
}

}  // namespace
}  // namespace twofold
