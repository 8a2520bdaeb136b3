#include "geometry/sim3.hpp"

#include <cmath>

namespace twofold {
namespace {

/// W = c I + a [w]x + b [w]x^2 of eq. 5.7, with theta = |w|:
///   c = int_0^1 e^(sigma u) du,  a = int_0^1 e^(sigma u) sin(theta u) / theta du,
///   b = int_0^1 e^(sigma u) (1 - cos(theta u)) / theta^2 du.
struct Coefficients {
  double c, a, b;
};

// Below this angle the closed form loses digits like 1 / theta^2.
constexpr double kSim3SeriesBelow = 0.5;
constexpr int kThetaTerms = 7;  // (theta^2)^7 / 16! < 1e-17 at kSim3SeriesBelow

/// Series in theta^2. The moments I_n = int_0^1 u^n e^(sigma u) du come from I_(n-1) = (e^sigma - sigma I_n)
/// / n, which damps errors when run downwards; it needs no division by sigma and so no limit.
Coefficients coefficients_small_angle(double sigma, double theta2) {
  constexpr int kMoments = 2 * kThetaTerms + 1;
  double moments[kMoments];
  const double e = std::exp(sigma);
  const int start = kMoments + 16 + 2 * static_cast<int>(std::abs(sigma));
  double I = e / (start + 1);
  for (int n = start; n > 0; --n) {
    I = (e - sigma * I) / n;
    if (n <= kMoments) moments[n - 1] = I;
  }
  Coefficients w{moments[0], 0, 0};
  // sin(theta u) / theta = sum_k f_k u^(2k+1), f_k = (-theta^2)^k / (2k+1)!; the cosine's factor is f_k /
  // (2k+2).
  double f = 1;
  for (int k = 0; k < kThetaTerms; ++k) {
    w.a += f * moments[2 * k + 1];
    w.b += f / (2 * k + 2) * moments[2 * k + 2];
    f *= -theta2 / ((2 * k + 2) * (2 * k + 3));
  }
  return w;
}

Coefficients coefficients(double sigma, double theta) {
  const double theta2 = theta * theta;
  if (theta < kSim3SeriesBelow) return coefficients_small_angle(sigma, theta2);
  const double A = std::exp(sigma) * std::sin(theta);
  const double B = std::exp(sigma) * std::cos(theta);
  const double c = sigma == 0 ? 1.0 : std::expm1(sigma) / sigma;
  const double n = sigma * sigma + theta2;
  return {c, (A * sigma + (1 - B) * theta) / (theta * n), (c - ((B - 1) * sigma + A * theta) / n) / theta2};
}

}  // namespace

Sim3 Sim3::exp(const Vector7& v_w_sigma) {
  const Vector3 v = v_w_sigma.head<3>();
  const Vector3 w = v_w_sigma.segment<3>(3);
  const double sigma = v_w_sigma[6];
  const Coefficients W = coefficients(sigma, w.norm());
  const Vector3 w_v = w.cross(v);
  return {std::exp(sigma), SO3::exp(w), W.c * v + W.a * w_v + W.b * w.cross(w_v)};
}

Vector7 Sim3::log() const {
  const Vector3 w = R_.log();
  const double theta2 = w.squaredNorm();
  const double sigma = std::log(s_);
  const auto [c, a, b] = coefficients(sigma, std::sqrt(theta2));
  // W has the eigenvalue c along w and p +- i a theta across it; its inverse has the same form, and written
  // as below no term is divided by theta.
  const double p = c - b * theta2;
  const double d = p * p + a * a * theta2;
  const double c_inv = 1 / c;
  const double a_inv = -a / d;
  const double b_inv = (a * a + b * b * theta2 - c * b) / (c * d);
  const Vector3 w_t = w.cross(t_);
  Vector7 result;
  result << c_inv * t_ + a_inv * w_t + b_inv * w.cross(w_t), w, sigma;
  return result;
}

Matrix4 Sim3::matrix() const {
  Matrix4 m = Matrix4::Identity();
  m.topLeftCorner<3, 3>() = s_ * rotation();
  m.topRightCorner<3, 1>() = t_;
  return m;
}

Sim3 Sim3::inverse() const {
  const SO3 R_inv = R_.inverse();
  const double s_inv = 1 / s_;
  return {s_inv, R_inv, -s_inv * (R_inv * t_)};
}

Matrix7 Sim3::adjoint() const {
  const Matrix3 R = rotation();
  Matrix7 ad = Matrix7::Zero();
  ad.topLeftCorner<3, 3>() = s_ * R;
  ad.block<3, 3>(0, 3) = hat(t_) * R;
  ad.topRightCorner<3, 1>() = -t_;
  ad.block<3, 3>(3, 3) = R;
  ad(6, 6) = 1;
  return ad;
}

}  // namespace twofold
