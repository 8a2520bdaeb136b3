#include "geometry/cbh.hpp"

#include <gtest/gtest.h>

#include <array>
#include <random>

#include "tests/numeric_derivative.hpp"

namespace twofold {
namespace {

template <class Group>
class Cbh : public ::testing::Test {
 protected:
  typename Group::Tangent random(double sigma) {
    typename Group::Tangent x;
    for (int i = 0; i < Group::kDof; ++i) x[i] = sigma * normal_(rng_);
    return x;
  }

 private:
  std::mt19937 rng_{5};
  std::normal_distribution<double> normal_;
};

using Groups = ::testing::Types<SO3, SE2, SE3, Sim3>;
TYPED_TEST_SUITE(Cbh, Groups);

template <class Group>
typename Group::AdjointMatrix numeric_pose_pose_jacobian(const Group& A, const Group& B) {
  return central_difference(
      [&](const typename Group::Tangent& e) {
        return typename Group::Tangent((A * Group::exp(e) * B).log());
      },
      Group::Tangent::Zero().eval(), 1e-5);
}

TYPED_TEST(Cbh, BracketIsTheDerivativeOfTheAdjoint) {  // thesis A.10 - A.13
  for (int i = 0; i < 20; ++i) {
    const auto u = this->random(1);
    const auto v = this->random(1);
    const double h = 1e-5;
    const typename TypeParam::Tangent numeric =
        (TypeParam::exp(h * u).adjoint() * v - TypeParam::exp(-h * u).adjoint() * v) / (2 * h);
    EXPECT_LT((lie_bracket<TypeParam>(u, v) - numeric).norm(), 1e-8);
    EXPECT_LT((lie_bracket<TypeParam>(u, v) + lie_bracket<TypeParam>(v, u)).norm(), 1e-14);
  }
}

TYPED_TEST(Cbh, BracketJacobianReproducesTheBracket) {
  for (int i = 0; i < 20; ++i) {
    const auto y = this->random(1);
    const auto d = this->random(1);
    EXPECT_LT((lie_bracket_jacobian<TypeParam>(d) * y - lie_bracket<TypeParam>(y, d)).norm(), 1e-14);
  }
}

TYPED_TEST(Cbh, ExactJacobianMatchesCentralDifference) {
  for (const double sigma : {1e-9, 1e-4, 0.03, 0.06, 0.3, 1.0, 1.5}) {
    for (int i = 0; i < 20; ++i) {
      auto a = this->random(sigma);
      auto b = this->random(sigma);
      const TypeParam A = TypeParam::exp(a);
      const TypeParam B = TypeParam::exp(b);
      const auto d = (A * B).log();
      if (d.norm() > 2.9 && TypeParam::kDof == 3) continue;  // differences across the cut at pi mean nothing
      if (TypeParam::kDof > 3 && d.template segment<3>(3).norm() > 2.9) continue;
      const auto J = pose_pose_jacobian(A, typename TypeParam::Tangent(d), CbhOrder::kExact);
      EXPECT_LT((J - numeric_pose_pose_jacobian(A, B)).norm(), 2e-8 * (1 + J.norm() * J.norm())) << sigma;
    }
  }
}

/// An expansion of order k leaves an error of order |d|^k (|d|^4 for the third: the fourth term of the series
/// has no part linear in y), so that dividing d by ten divides the error by 10, 100 and 10^4.
TYPED_TEST(Cbh, OrdersConvergeAsPredicted) {
  for (int trial = 0; trial < 10; ++trial) {
    const auto direction = this->random(1).normalized().eval();
    const auto error = [&](double length, CbhOrder order) {
      const typename TypeParam::Tangent d = length * direction;
      return (cbh_jacobian<TypeParam>(d, order) - cbh_jacobian<TypeParam>(d, CbhOrder::kExact)).norm();
    };
    EXPECT_NEAR(error(0.1, CbhOrder::kFirst) / error(0.01, CbhOrder::kFirst), 10, 0.5);
    EXPECT_NEAR(error(0.1, CbhOrder::kSecond) / error(0.01, CbhOrder::kSecond), 100, 5);
    EXPECT_NEAR(error(0.1, CbhOrder::kThird) / error(0.01, CbhOrder::kThird), 1e4, 500);
  }
}

/// eq. 5.18, 5.19: both derivatives of the pose-graph error by the poses' left perturbations.
TYPED_TEST(Cbh, PoseGraphErrorDerivatives) {
  using Tangent = typename TypeParam::Tangent;
  using Jacobian = typename TypeParam::AdjointMatrix;
  const TypeParam T_ji = TypeParam::exp(this->random(0.5));
  const TypeParam T_i = TypeParam::exp(this->random(0.5));
  const TypeParam T_j = TypeParam::exp(this->random(0.3)) * T_ji * T_i;
  const Tangent d = (T_ji * T_i * T_j.inverse()).log();
  const Jacobian J_i = pose_pose_jacobian(T_ji, d, CbhOrder::kExact);
  const Jacobian J_j = -cbh_jacobian<TypeParam>(-d, CbhOrder::kExact);
  const Jacobian numeric_i = central_difference(
      [&](const Tangent& e) { return Tangent((T_ji * (TypeParam::exp(e) * T_i) * T_j.inverse()).log()); },
      Tangent::Zero().eval());
  const Jacobian numeric_j = central_difference(
      [&](const Tangent& e) { return Tangent((T_ji * T_i * (TypeParam::exp(e) * T_j).inverse()).log()); },
      Tangent::Zero().eval());
  EXPECT_LT((J_i - numeric_i).norm(), 1e-8 * (1 + J_i.norm()));
  EXPECT_LT((J_j - numeric_j).norm(), 1e-8 * (1 + J_j.norm()));
}

}  // namespace
}  // namespace twofold
