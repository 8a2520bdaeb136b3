#include "estimation/pose_constraint.hpp"

#include <cmath>

namespace twofold {
namespace {

/// Matrix of y -> [v, y], the Lie bracket of se(3)  (thesis A.2.1).
Matrix6 lie_bracket_matrix(const Vector6& v) {
  const Matrix3 W = hat(v.tail<3>());
  Matrix6 ad;
  ad << W, hat(v.head<3>()), Matrix3::Zero(), W;
  return ad;
}

struct EvenCoefficients {
  double c2, c4;
};

/// The inverse left Jacobian is g(ad^2) - ad/2 with g(s) = sqrt(s)/2 coth(sqrt(s)/2). ad^2 has the eigenvalue
/// -theta^2 twice (ad^5 + 2 theta^2 ad^3 + theta^4 ad = 0), so that g(s) = 1 + c2 s + c4 s^2 where value and
/// slope agree at s = -theta^2.
EvenCoefficients even_coefficients(double theta2) {
  constexpr double kSmallTheta2 = 0.09;  // both branches are accurate to 1e-13 here
  const double t = theta2;
  if (t < kSmallTheta2) {
    const double c4 = -(1.0 / 720 + t * (2.0 / 30240 + t * (3.0 / 1209600 + t * 4.0 / 47900160)));
    const double slope =
        1.0 / 12 + t * (2.0 / 720 + t * (3.0 / 30240 + t * (4.0 / 1209600 + t * 5.0 / 47900160)));
    return {slope + 2 * c4 * t, c4};
  }
  const double theta = std::sqrt(t);
  const double sin_half = std::sin(0.5 * theta);
  const double cot_half = std::cos(0.5 * theta) / sin_half;
  const double g = 0.5 * theta * cot_half;
  const double slope = (0.25 * theta / (sin_half * sin_half) - 0.5 * cot_half) / (2 * theta);
  const double c4 = (1 - g - slope * t) / (t * t);
  return {slope + 2 * c4 * t, c4};
}

}  // namespace

Matrix6 se3_left_jacobian_inverse(const Vector6& v) {
  const Matrix6 ad = lie_bracket_matrix(v);
  const Matrix6 ad2 = ad * ad;
  const auto [c2, c4] = even_coefficients(v.tail<3>().squaredNorm());
  Matrix6 J = Matrix6::Identity() - 0.5 * ad + c2 * ad2;
  J.noalias() += c4 * ad2 * ad2;
  return J;
}

Vector6 pose_constraint_error(const SE3& T_j_i, const SE3& T_i_w, const SE3& T_j_w) {
  return (T_j_i * T_i_w * T_j_w.inverse()).log();
}

PoseConstraintTerms linearise_pose_constraint(const SE3& T_j_i, const SE3& T_i_w, const SE3& T_j_w) {
  PoseConstraintTerms terms;
  terms.v = pose_constraint_error(T_j_i, T_i_w, T_j_w);
  // T_ji exp(x) T_i T_j^-1 = exp(Ad x) E  and  E exp(-x) = (exp(x) E^-1)^-1
  terms.J_i = se3_left_jacobian_inverse(terms.v) * T_j_i.adjoint();
  terms.J_j = -se3_left_jacobian_inverse(-terms.v);
  return terms;
}

}  // namespace twofold
