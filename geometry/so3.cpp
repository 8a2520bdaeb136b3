#include "geometry/so3.hpp"

#include <cmath>

namespace twofold {
namespace {
// Below this angle the Taylor expansions used here are exact to double precision.
constexpr double kSo3SeriesBelow = 1e-4;
}  // namespace

SO3 SO3::exp(const Vector3& w) {
  const double theta = w.norm();
  const double half = 0.5 * theta;
  // sin(theta/2)/theta = 1/2 - theta^2/48 + O(theta^4)
  const double k = theta < kSo3SeriesBelow ? 0.5 - theta * theta / 48.0 : std::sin(half) / theta;
  return unchecked(Eigen::Quaterniond(std::cos(half), k * w.x(), k * w.y(), k * w.z()));
}

Vector3 SO3::log() const {
  // q and -q are the same rotation; the one with w >= 0 has the angle in [0, pi].
  const double sign = q_.w() < 0 ? -1.0 : 1.0;
  const double cos_half = sign * q_.w();
  const Vector3 v = sign * q_.vec();
  const double sin_half = v.norm();
  // atan2 stays accurate at both ends; near zero 2 atan2(s, c) / s -> 2/c - (2/3) s^2/c^3.
  const double k = sin_half < kSo3SeriesBelow
                       ? 2.0 / cos_half - 2.0 / 3.0 * sin_half * sin_half / (cos_half * cos_half * cos_half)
                       : 2.0 * std::atan2(sin_half, cos_half) / sin_half;
  return k * v;
}

SO3 SO3::operator*(const SO3& other) const {
  Eigen::Quaterniond q = q_ * other.q_;
  // One Newton step of 1/sqrt keeps long products on the unit sphere for the price of a few multiplications.
  q.coeffs() *= 1.5 - 0.5 * q.squaredNorm();
  return unchecked(q);
}

}  // namespace twofold
