#include "geometry/cbh.hpp"

#include <array>
#include <cmath>

namespace twofold {

template <>
Vector3 lie_bracket<SO3>(const Vector3& a, const Vector3& b) {
  return a.cross(b);
}

template <>
Vector3 lie_bracket<SE2>(const Vector3& a, const Vector3& b) {
  return {-a.z() * b.y() + b.z() * a.y(), a.z() * b.x() - b.z() * a.x(), 0.0};
}

template <>
Vector6 lie_bracket<SE3>(const Vector6& a, const Vector6& b) {
  const Vector3 w = a.tail<3>(), phi = b.tail<3>();
  Vector6 r;
  r << w.cross(b.head<3>()) - phi.cross(a.head<3>()), w.cross(phi);
  return r;
}

template <>
Vector7 lie_bracket<Sim3>(const Vector7& a, const Vector7& b) {
  const Vector3 v = a.head<3>(), w = a.segment<3>(3), tau = b.head<3>(), phi = b.segment<3>(3);
  Vector7 r;
  r << w.cross(tau) + v.cross(phi) + a[6] * tau - b[6] * v, w.cross(phi), 0.0;
  return r;
}

template <>
Matrix3 lie_bracket_jacobian<SO3>(const Vector3& d) {
  return -hat(d);
}

template <>
Matrix3 lie_bracket_jacobian<SE2>(const Vector3& d) {
  Matrix3 D;
  D << 0, d.z(), -d.y(), -d.z(), 0, d.x(), 0, 0, 0;
  return D;
}

template <>
Matrix6 lie_bracket_jacobian<SE3>(const Vector6& d) {
  const Matrix3 phi = hat(d.tail<3>());
  Matrix6 D;
  D << -phi, -hat(d.head<3>()), Matrix3::Zero(), -phi;
  return D;
}

template <>
Matrix7 lie_bracket_jacobian<Sim3>(const Vector7& d) {
  const Vector3 tau = d.head<3>();
  const Matrix3 phi = hat(d.segment<3>(3));
  Matrix7 D = Matrix7::Zero();
  D.topLeftCorner<3, 3>() = -phi - d[6] * Matrix3::Identity();
  D.block<3, 3>(0, 3) = -hat(tau);
  D.topRightCorner<3, 1>() = tau;
  D.block<3, 3>(3, 3) = -phi;
  return D;
}

namespace {

/// h(m) = (theta/2) cot(theta/2) with m = theta^2, as (1 - h) / m and dh/dm.
struct HalfCot {
  double one_minus_h_over_m;
  double dh_dm;
};

HalfCot half_cot(double m) {
  if (m < 1e-2) {  // 1 - h = m/12 + m^2/720 + m^3/30240 + m^4/1209600 + m^5/47900160 + ...
    return {1.0 / 12 + m * (1.0 / 720 + m * (1.0 / 30240 + m * (1.0 / 1209600 + m / 47900160))),
            -(1.0 / 12 + m * (1.0 / 360 + m * (1.0 / 10080 + m * (1.0 / 302400 + m / 9580032))))};
  }
  const double half = 0.5 * std::sqrt(m);
  const double s = std::sin(half);
  const double cot = std::cos(half) / s;
  return {(1 - half * cot) / m, (cot - half / (s * s)) / (8 * half)};
}

/// The even part g(D) = sum B_2n/(2n)! D^2n of the series. On the eigenvalues 0 and +-i theta of D, g is 1
/// and h(m).

/// D (D^2 + m I) = 0: simple eigenvalues, g = I + c D^2 with 1 - c m = h.
Matrix3 even_part(const Matrix3& D, double m) {
  return Matrix3::Identity() + half_cot(m).one_minus_h_over_m * (D * D);
}

/// D (D^2 + m I)^2 = 0: double eigenvalues, so that g = I + c2 D^2 + c4 D^4 must have the right derivative
/// there too: 1 - c2 m + c4 m^2 = h and -c2 + 2 c4 m = dh/dm.
Matrix6 even_part(const Matrix6& D, double m) {
  const HalfCot h = half_cot(m);
  const double c2 = 2 * h.one_minus_h_over_m + h.dh_dm;
  const double c4 = m < 1e-2 ? -1.0 / 720 - m * (1.0 / 15120 + m * (3.0 / 1209600 + m * 4.0 / 47900160))
                             : (h.dh_dm + h.one_minus_h_over_m) / m;
  const Matrix6 D2 = D * D;
  return Matrix6::Identity() + c2 * D2 + c4 * (D2 * D2);
}

/// B_2n / (2n)! = (-1)^(n+1) 2 zeta(2n) / (2 pi)^(2n) for n = 1..kCount.
constexpr int kCount = 26;  // |ad_d| <= about pi: the terms fall like 4^-n
std::array<double, kCount> bernoulli_over_factorial() {
  std::array<double, kCount> c{1.0 / 12, -1.0 / 720};
  for (int n = 3; n <= kCount; ++n) {
    double zeta = 0;
    for (int k = 400; k > 0; --k) zeta += std::pow(static_cast<double>(k), -2.0 * n);
    c[n - 1] = (n % 2 ? 2 : -2) * zeta * std::pow(2 * M_PI, -2.0 * n);
  }
  return c;
}

Matrix7 even_part(const Matrix7& D) {
  static const std::array<double, kCount> kCoefficients = bernoulli_over_factorial();
  const Matrix7 D2 = D * D;
  Matrix7 sum = Matrix7::Identity();
  Matrix7 power = D2;
  for (const double c : kCoefficients) {
    const Matrix7 term = c * power;
    sum += term;
    if (term.lpNorm<Eigen::Infinity>() < 1e-17) break;
    power = power * D2;
  }
  return sum;
}

template <class Matrix>
Matrix truncated(const Matrix& D, CbhOrder order) {
  Matrix J = Matrix::Identity();
  if (order >= CbhOrder::kSecond) J += 0.5 * D;
  if (order >= CbhOrder::kThird) J += (1.0 / 12) * (D * D);
  return J;
}

}  // namespace

template <>
Matrix3 cbh_jacobian<SO3>(const Vector3& d, CbhOrder order) {
  const Matrix3 D = lie_bracket_jacobian<SO3>(d);
  return order == CbhOrder::kExact ? Matrix3(even_part(D, d.squaredNorm()) + 0.5 * D) : truncated(D, order);
}

template <>
Matrix3 cbh_jacobian<SE2>(const Vector3& d, CbhOrder order) {
  const Matrix3 D = lie_bracket_jacobian<SE2>(d);
  return order == CbhOrder::kExact ? Matrix3(even_part(D, d.z() * d.z()) + 0.5 * D) : truncated(D, order);
}

template <>
Matrix6 cbh_jacobian<SE3>(const Vector6& d, CbhOrder order) {
  const Matrix6 D = lie_bracket_jacobian<SE3>(d);
  return order == CbhOrder::kExact ? Matrix6(even_part(D, d.tail<3>().squaredNorm()) + 0.5 * D)
                                   : truncated(D, order);
}

template <>
Matrix7 cbh_jacobian<Sim3>(const Vector7& d, CbhOrder order) {
  const Matrix7 D = lie_bracket_jacobian<Sim3>(d);
  return order == CbhOrder::kExact ? Matrix7(even_part(D) + 0.5 * D) : truncated(D, order);
}

}  // namespace twofold
