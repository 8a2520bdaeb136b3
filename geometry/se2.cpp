#include "geometry/se2.hpp"

#include <cmath>

namespace twofold {
namespace {
constexpr double kSe2SeriesBelow = 1e-3;
}  // namespace

SE2::SE2(double angle, const Vector2& t) : cos_(std::cos(angle)), sin_(std::sin(angle)), t_(t) {}

SE2 SE2::exp(const Vector3& v_w) {
  const double w = v_w.z();
  const double w2 = w * w;
  // V = [a, -b; b, a] with a = sin w / w, b = (1 - cos w) / w
  const bool small = std::abs(w) < kSe2SeriesBelow;
  const double a = small ? 1 - w2 * (1.0 / 6 - w2 / 120) : std::sin(w) / w;
  const double b = small ? w * (0.5 - w2 * (1.0 / 24 - w2 / 720)) : (1 - std::cos(w)) / w;
  return {w, Vector2(a * v_w.x() - b * v_w.y(), b * v_w.x() + a * v_w.y())};
}

Vector3 SE2::log() const {
  const double w = angle();
  // V^-1 = [h, w/2; -w/2, h] with h = (w/2) cot(w/2)
  const double w2 = w * w;
  const double h = std::abs(w) < kSe2SeriesBelow ? 1 - w2 * (1.0 / 12 + w2 / 720)
                                                 : 0.5 * w * std::cos(0.5 * w) / std::sin(0.5 * w);
  return {h * t_.x() + 0.5 * w * t_.y(), -0.5 * w * t_.x() + h * t_.y(), w};
}

double SE2::angle() const {
  return std::atan2(sin_, cos_);
}

Eigen::Matrix2d SE2::rotation() const {
  Eigen::Matrix2d R;
  R << cos_, -sin_, sin_, cos_;
  return R;
}

SE2 SE2::inverse() const {
  SE2 inv;
  inv.cos_ = cos_;
  inv.sin_ = -sin_;
  inv.t_ = -Vector2(cos_ * t_.x() + sin_ * t_.y(), -sin_ * t_.x() + cos_ * t_.y());
  return inv;
}

Matrix3 SE2::adjoint() const {
  Matrix3 ad;
  ad << cos_, -sin_, t_.y(), sin_, cos_, -t_.x(), 0, 0, 1;
  return ad;
}

SE2 SE2::operator*(const SE2& other) const {
  SE2 r;
  r.cos_ = cos_ * other.cos_ - sin_ * other.sin_;
  r.sin_ = sin_ * other.cos_ + cos_ * other.sin_;
  // One Newton step of 1/sqrt keeps long products on the unit circle.
  const double k = 1.5 - 0.5 * (r.cos_ * r.cos_ + r.sin_ * r.sin_);
  r.cos_ *= k;
  r.sin_ *= k;
  r.t_ = *this * other.t_;
  return r;
}

}  // namespace twofold
