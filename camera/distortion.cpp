#include "camera/distortion.hpp"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>

#include "geometry/positive_polynomial.hpp"

namespace twofold {
namespace {

using Matrix2 = Eigen::Matrix2d;
using Coefficients = Distortion::Coefficients;

/// Distortion along the radius: xy_d = g(r) xy with r = |xy|, given g and dg = g'(r) / r.
Vector2 scale_radially(const Vector2& xy, double g, double dg, Matrix2* J) {
  if (J) *J = g * Matrix2::Identity() + dg * xy * xy.transpose();
  return g * xy;
}

/// Radial part of kRadTan and kRational: numerator and denominator as polynomials of s = r^2.
struct RadialQuotient {
  std::array<double, 4> N, D;

  RadialQuotient(DistortionModel model, const Coefficients& k) : N{1, k[0], k[1], k[4]}, D{1, 0, 0, 0} {
    if (model == DistortionModel::kRational) std::copy(k.begin() + 5, k.end(), D.begin() + 1);
  }

  /// Positive where r N / D grows: D^2 d(r N / D)/dr = (N + 2 s dN/ds) D - N 2 s dD/ds.
  [[nodiscard]] std::array<double, 7> growth() const {
    std::array<double, 7> sum{};
    for (int i = 0; i < 4; ++i) {
      for (int j = 0; j < 4; ++j) sum[i + j] += (1 + 2 * i - 2 * j) * N[i] * D[j];
    }
    return sum;
  }
};

/// Adds 2 p1 x y + p2 (r^2 + 2 x^2) to x_d, and likewise to y_d with p1, p2 swapped.
Vector2 shift_tangentially(const Vector2& xy, const Coefficients& k, const Vector2& xy_d, Matrix2* J) {
  const double p1 = k[2], p2 = k[3];
  const double x = xy.x(), y = xy.y();
  const double r2 = xy.squaredNorm();
  if (J) {
    const double cross = 2 * (p1 * x + p2 * y);
    (*J)(0, 0) += 2 * p1 * y + 6 * p2 * x;
    (*J)(0, 1) += cross;
    (*J)(1, 0) += cross;
    (*J)(1, 1) += 6 * p1 * y + 2 * p2 * x;
  }
  return xy_d + Vector2(2 * p1 * x * y + p2 * (r2 + 2 * x * x), p1 * (r2 + 2 * y * y) + 2 * p2 * x * y);
}

/// x_d = x (1 + k1 r^2 + k2 r^4 + k3 r^6) + the tangential shift, and likewise in y.
Vector2 radtan(const Vector2& xy, const Coefficients& k, Matrix2* J) {
  const double k1 = k[0], k2 = k[1], k3 = k[4];
  const double r2 = xy.squaredNorm();
  const double g = 1 + r2 * (k1 + r2 * (k2 + r2 * k3));
  const double dg = 2 * (k1 + r2 * (2 * k2 + r2 * 3 * k3));
  return shift_tangentially(xy, k, scale_radially(xy, g, dg, J), J);
}

/// As radtan, with g = N / D.
Vector2 rational(const Vector2& xy, const Coefficients& k, Matrix2* J) {
  const auto [N, D] = RadialQuotient(DistortionModel::kRational, k);
  const double s = xy.squaredNorm();
  const double denominator = D[0] + s * (D[1] + s * (D[2] + s * D[3]));
  const double g = (N[0] + s * (N[1] + s * (N[2] + s * N[3]))) / denominator;
  const double slope_of_n = N[1] + s * (2 * N[2] + s * 3 * N[3]);
  const double slope_of_d = D[1] + s * (2 * D[2] + s * 3 * D[3]);
  const double dg = 2 * (slope_of_n - g * slope_of_d) / denominator;
  return shift_tangentially(xy, k, scale_radially(xy, g, dg, J), J);
}

/// r_d = theta (1 + k1 theta^2 + ... + k4 theta^8) with theta = atan r.
Vector2 equidistant(const Vector2& xy, const Coefficients& k, Matrix2* J) {
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
Vector2 double_sphere(const Vector2& xy, const Coefficients& k, Matrix2* J) {
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
    case DistortionModel::kRational:
      return 8;
  }
  return 0;
}

bool Distortion::is_identity() const {
  if (model == DistortionModel::kNone) return true;
  if (model != DistortionModel::kRadTan && model != DistortionModel::kRational) return false;
  return std::all_of(coefficients.begin(), coefficients.begin() + coefficient_count(),
                     [](double k) { return k == 0; });
}

std::string Distortion::invalid_reason() const {
  constexpr double kLargest = 1e9;  // those of lenses are below a thousand; products must stay finite
  for (int i = 0; i < coefficient_count(); ++i) {
    if (!std::isfinite(coefficients[i]))
      return "distortion coefficient " + std::to_string(i + 1) + " is not finite";
    if (std::abs(coefficients[i]) > kLargest)
      return "distortion coefficient " + std::to_string(i + 1) + " must be within 1e9";
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
    case DistortionModel::kRational:
      return rational(xy, coefficients, J);
    case DistortionModel::kNone:
      break;
  }
  if (J) J->setIdentity();
  return xy;
}

bool Distortion::reaches(const Vector2& xy) const {
  switch (model) {
    case DistortionModel::kRadTan:
    case DistortionModel::kRational: {
      const RadialQuotient radial(model, coefficients);
      const double s = xy.squaredNorm();
      return is_positive_to(s, radial.D) && is_positive_to(s, radial.growth());
    }
    case DistortionModel::kEquidistant: {
      const auto& k = coefficients;
      const double theta = std::atan(xy.norm());
      return is_positive_to(theta * theta, std::array{1.0, 3 * k[0], 5 * k[1], 7 * k[2], 9 * k[3]});
    }
    case DistortionModel::kDoubleSphere:
    case DistortionModel::kNone:
      break;
  }
  return true;
}

std::optional<Vector2> Distortion::undistort(const Vector2& xy_d) const {
  if (!std::isfinite(xy_d.squaredNorm())) return std::nullopt;
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
    Vector2 error_new;
    const auto climbs = [&] {
      error_new = xy_d - distort(xy + step, &J_new);
      return error_new.norm() < error.norm() && reaches(xy + step);
    };
    bool better = climbs();
    for (int halving = 0; !better && halving < 20; ++halving) {
      step *= 0.5;
      better = climbs();
    }
    if (!better) break;
    xy += step;
    error = error_new;
    J = J_new;
  }
  if (!(error.norm() <= 1e-9 * (1 + xy_d.norm()))) return std::nullopt;
  // On the central branch the image grows, tangential terms included, all the way from the axis to the
  // solution.
  for (int i = 1; i <= kChecks; ++i) {
    (void)distort(xy * (static_cast<double>(i) / kChecks), &J);
    if (!(J.determinant() > 0)) return std::nullopt;
  }
  return xy;
}

}  // namespace twofold
