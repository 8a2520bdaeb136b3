#include "camera/distortion.hpp"

#include <Eigen/LU>
#include <cmath>

namespace twofold {
namespace {

using Matrix2 = Eigen::Matrix2d;

/// Distortion along the radius: xy_d = g(r) xy with r = |xy|, given g and dg = g'(r) / r.
Vector2 scale_radially(const Vector2& xy, double g, double dg, Matrix2* J) {
  if (J) *J = g * Matrix2::Identity() + dg * xy * xy.transpose();
  return g * xy;
}

/// x_d = x (1 + k1 r^2 + k2 r^4 + k3 r^6) + 2 p1 x y + p2 (r^2 + 2 x^2), and likewise in y with p1, p2
/// swapped.
Vector2 radtan(const Vector2& xy, const std::array<double, 5>& k, Matrix2* J) {
  const auto [k1, k2, p1, p2, k3] = k;
  const double x = xy.x(), y = xy.y();
  const double r2 = xy.squaredNorm();
  const double g = 1 + r2 * (k1 + r2 * (k2 + r2 * k3));
  const double dg = 2 * (k1 + r2 * (2 * k2 + r2 * 3 * k3));
  const Vector2 xy_d = scale_radially(xy, g, dg, J);
  if (J) {
    const double cross = 2 * (p1 * x + p2 * y);
    (*J)(0, 0) += 2 * p1 * y + 6 * p2 * x;
    (*J)(0, 1) += cross;
    (*J)(1, 0) += cross;
    (*J)(1, 1) += 6 * p1 * y + 2 * p2 * x;
  }
  return xy_d + Vector2(2 * p1 * x * y + p2 * (r2 + 2 * x * x), p1 * (r2 + 2 * y * y) + 2 * p2 * x * y);
}

/// r_d = theta (1 + k1 theta^2 + ... + k4 theta^8) with theta = atan r.
Vector2 equidistant(const Vector2& xy, const std::array<double, 5>& k, Matrix2* J) {
  const double r2 = xy.squaredNorm();
  if (r2 < 1e-12) {  // g = 1 + (k1 - 1/3) r^2
    return scale_radially(xy, 1 + (k[0] - 1.0 / 3) * r2, 2 * (k[0] - 1.0 / 3), J);
  }
  const double r = std::sqrt(r2);
  const double theta = std::atan(r);
  const double t2 = theta * theta;
  const double r_d = theta * (1 + t2 * (k[0] + t2 * (k[1] + t2 * (k[2] + t2 * k[3]))));
  const double dr_d = (1 + t2 * (3 * k[0] + t2 * (5 * k[1] + t2 * (7 * k[2] + t2 * 9 * k[3])))) / (1 + r2);
  return scale_radially(xy, r_d / r, (dr_d - r_d / r) / r2, J);
}

/// r_d = r / (alpha d2 + (1 - alpha) c), d1 = sqrt(r^2 + 1), c = xi d1 + 1, d2 = sqrt(r^2 + c^2).
Vector2 double_sphere(const Vector2& xy, const std::array<double, 5>& k, Matrix2* J) {
  const double xi = k[0], alpha = k[1];
  const double r2 = xy.squaredNorm();
  const double d1 = std::sqrt(r2 + 1);
  const double c = xi * d1 + 1;
  const double d2 = std::sqrt(r2 + c * c);
  const double g = 1 / (alpha * d2 + (1 - alpha) * c);
  const double dc = xi / d1;             // (dc/dr) / r
  const double dd2 = (1 + c * dc) / d2;  // (d d2/dr) / r
  return scale_radially(xy, g, -g * g * (alpha * dd2 + (1 - alpha) * dc), J);
}

}  // namespace

int Distortion::coefficient_count() const {
  switch (model) {
    case DistortionModel::kNone:
      return 0;
    case DistortionModel::kRadTan:
      return 5;
    case DistortionModel::kEquidistant:
      return 4;
    case DistortionModel::kDoubleSphere:
      return 2;
  }
  return 0;
}

bool Distortion::is_identity() const {
  if (model == DistortionModel::kNone) return true;
  return model == DistortionModel::kRadTan && coefficients == std::array<double, 5>{};
}

std::string Distortion::invalid_reason() const {
  for (int i = 0; i < coefficient_count(); ++i) {
    if (!std::isfinite(coefficients[i]))
      return "distortion coefficient " + std::to_string(i + 1) + " is not finite";
  }
  if (model == DistortionModel::kDoubleSphere && !(coefficients[1] >= 0 && coefficients[1] <= 1)) {
    return "double sphere alpha must be in [0, 1], is " + std::to_string(coefficients[1]);
  }
  if (model == DistortionModel::kDoubleSphere && !(coefficients[0] > -1 && coefficients[0] < 1)) {
    return "double sphere xi must be in (-1, 1), is " + std::to_string(coefficients[0]);
  }
  return {};
}

Vector2 Distortion::distort(const Vector2& xy, Eigen::Matrix2d* J) const {
  switch (model) {
    case DistortionModel::kRadTan:
      return radtan(xy, coefficients, J);
    case DistortionModel::kEquidistant:
      return equidistant(xy, coefficients, J);
    case DistortionModel::kDoubleSphere:
      return double_sphere(xy, coefficients, J);
    case DistortionModel::kNone:
      break;
  }
  if (J) J->setIdentity();
  return xy;
}

std::optional<Vector2> Distortion::undistort(const Vector2& xy_d) const {
  if (is_identity()) return xy_d;
  constexpr int kMaxIterations = 50;
  constexpr double kTolerance = 1e-13;
  constexpr int kChecks = 8;
  Vector2 xy = Vector2::Zero();
  Matrix2 J;
  Vector2 error = xy_d - distort(xy, &J);
  // Starting at the axis, with steps halved until the error falls, the iterate climbs the central branch.
  for (int iteration = 0; iteration < kMaxIterations && error.norm() > kTolerance * (1 + xy_d.norm());
       ++iteration) {
    if (!(J.determinant() > 0)) return std::nullopt;
    Vector2 step = J.inverse() * error;
    Matrix2 J_new;
    Vector2 error_new = xy_d - distort(xy + step, &J_new);
    for (int halving = 0; !(error_new.norm() < error.norm()) && halving < 20; ++halving) {
      step *= 0.5;
      error_new = xy_d - distort(xy + step, &J_new);
    }
    if (!(error_new.norm() < error.norm())) break;
    xy += step;
    error = error_new;
    J = J_new;
  }
  if (!(error.norm() <= 1e-9 * (1 + xy_d.norm()))) return std::nullopt;
  // On the central branch the radius grows all the way from the axis to the solution.
  for (int i = 1; i <= kChecks; ++i) {
    (void)distort(xy * (static_cast<double>(i) / kChecks), &J);
    if (!(J.determinant() > 0)) return std::nullopt;
  }
  return xy;
}

}  // namespace twofold
