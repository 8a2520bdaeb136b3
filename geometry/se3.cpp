#include "geometry/se3.hpp"

#include <cmath>

namespace twofold {
namespace {
// Where the closed forms of the coefficients lose digits to cancellation, their Taylor series have full
// accuracy.
constexpr double kSe3SeriesBelow = 1e-2;
}  // namespace

SE3 SE3::exp(const Vector6& v_w) {
  const Vector3 v = v_w.head<3>();
  const Vector3 w = v_w.tail<3>();
  const double theta2 = w.squaredNorm();
  const double theta = std::sqrt(theta2);
  double b;  // (1 - cos theta) / theta^2
  double c;  // (theta - sin theta) / theta^3
  if (theta < kSe3SeriesBelow) {
    b = 0.5 - theta2 * (1.0 / 24 - theta2 * (1.0 / 720 - theta2 / 40320));
    c = 1.0 / 6 - theta2 * (1.0 / 120 - theta2 * (1.0 / 5040 - theta2 / 362880));
  } else {
    b = (1.0 - std::cos(theta)) / theta2;
    c = (theta - std::sin(theta)) / (theta2 * theta);
  }
  const Vector3 w_v = w.cross(v);
  return {SO3::exp(w), v + b * w_v + c * w.cross(w_v)};
}

Vector6 SE3::log() const {
  const Vector3 w = R_.log();
  const double theta2 = w.squaredNorm();
  const double theta = std::sqrt(theta2);
  // V^-1 = I - [w]/2 + d [w]^2,  d = (1 - theta/2 cot(theta/2)) / theta^2
  const double d = theta < kSe3SeriesBelow
                       ? 1.0 / 12 + theta2 * (1.0 / 720 + theta2 * (1.0 / 30240 + theta2 / 1209600))
                       : (1.0 - 0.5 * theta * std::cos(0.5 * theta) / std::sin(0.5 * theta)) / theta2;
  const Vector3 w_t = w.cross(t_);
  Vector6 result;
  result << t_ - 0.5 * w_t + d * w.cross(w_t), w;
  return result;
}

Matrix4 SE3::matrix() const {
  Matrix4 m = Matrix4::Identity();
  m.topLeftCorner<3, 3>() = rotation();
  m.topRightCorner<3, 1>() = t_;
  return m;
}

SE3 SE3::inverse() const {
  const SO3 R_inv = R_.inverse();
  return {R_inv, -(R_inv * t_)};
}

Matrix6 SE3::adjoint() const {
  const Matrix3 R = rotation();
  Matrix6 ad;
  ad << R, hat(t_) * R, Matrix3::Zero(), R;
  return ad;
}

}  // namespace twofold
