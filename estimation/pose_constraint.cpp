#include "estimation/pose_constraint.hpp"

#include <cmath>

namespace twofold {
namespace {

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

/// The Lie bracket's matrix is ad = [W U; 0 W] with W = [w]x, U = [u]x for v = (u, w)  (thesis A.2.1), so all
/// its powers have that form, and those of W are W^3 = -theta^2 W and W^4 = -theta^2 W^2.
Matrix6 se3_left_jacobian_inverse(const Vector6& v) {
  const Matrix3 U = hat(v.head<3>()), W = hat(v.tail<3>());
  const double theta2 = v.tail<3>().squaredNorm();
  const auto [c2, c4] = even_coefficients(theta2);
  const Matrix3 W2 = W * W;
  const Matrix3 X = W * U + U * W;  // ad^2 = [W^2 X; 0 W^2], ad^4 = [W^4 W^2 X + X W^2; 0 W^4]
  Matrix6 J;
  J.topLeftCorner<3, 3>() = Matrix3::Identity() - 0.5 * W + (c2 - c4 * theta2) * W2;
  J.topRightCorner<3, 3>() = -0.5 * U + c2 * X + c4 * (W2 * X + X * W2);
  J.bottomLeftCorner<3, 3>().setZero();
  J.bottomRightCorner<3, 3>() = J.topLeftCorner<3, 3>();
  return J;
}

Vector6 pose_constraint_error(const SE3& T_j_i, const SE3& T_i_w, const SE3& T_j_w) {
  return (T_j_i * T_i_w * T_j_w.inverse()).log();
}

}  // namespace twofold
