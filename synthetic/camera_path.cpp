#include "synthetic/camera_path.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <utility>

#include "base/angles.hpp"
#include "base/check.hpp"

namespace twofold::synthetic {
namespace {

constexpr double kTurn = 2 * std::numbers::pi;
constexpr int kStepsPerSpan = 64;

}  // namespace

SE3 looking(const Vector3& position, double yaw, double pitch, double roll) {
  Matrix3 R_w_level;  // camera axes (right, down, forward) for yaw = 0
  R_w_level << 0, 0, 1, -1, 0, 0, 0, -1, 0;
  const SO3 R_w_c = SO3::exp(Vector3(0, 0, yaw)) * SO3(R_w_level) * SO3::exp(Vector3(pitch, 0, 0)) *
                    SO3::exp(Vector3(0, 0, roll));
  return {R_w_c, position};
}

ClosedCurve::ClosedCurve(std::vector<Vector2> control_points) : points_(std::move(control_points)) {
  TWOFOLD_CHECK(points_.size() >= 4, "a closed cubic spline needs four points");
  const int steps = static_cast<int>(points_.size()) * kStepsPerSpan;
  arc_.assign(1, 0.0);
  Vector2 previous = at(0);
  for (int k = 1; k <= steps; ++k) {
    const Vector2 next = at(static_cast<double>(k) / kStepsPerSpan);
    arc_.push_back(arc_.back() + (next - previous).norm());
    previous = next;
  }
}

Vector2 ClosedCurve::at(double parameter) const {
  const auto n = points_.size();
  const auto span = static_cast<std::size_t>(parameter);
  const double t = parameter - static_cast<double>(span);
  const double u = 1 - t;
  return (u * u * u * points_[span % n] + (3 * t * t * t - 6 * t * t + 4) * points_[(span + 1) % n] +
          (3 * u * u * u - 6 * u * u + 4) * points_[(span + 2) % n] + t * t * t * points_[(span + 3) % n]) /
         6;
}

Vector2 ClosedCurve::tangent(double parameter) const {
  const auto n = points_.size();
  const auto span = static_cast<std::size_t>(parameter);
  const double t = parameter - static_cast<double>(span);
  const double u = 1 - t;
  return 0.5 * (-u * u * points_[span % n] + (3 * t * t - 4 * t) * points_[(span + 1) % n] +
                (4 * u - 3 * u * u) * points_[(span + 2) % n] + t * t * points_[(span + 3) % n]);
}

double ClosedCurve::parameter(double s) const {
  s -= std::floor(s / length()) * length();
  const auto upper = std::upper_bound(arc_.begin() + 1, arc_.end() - 1, s);
  const auto k = static_cast<double>(upper - arc_.begin() - 1);
  const double a = *(upper - 1);
  return (k + (s - a) / (*upper - a)) / kStepsPerSpan;
}

Vector2 ClosedCurve::position(double s) const {
  return at(parameter(s));
}

double ClosedCurve::heading(double s) const {
  const Vector2 d = tangent(parameter(s));
  return std::atan2(d.y(), d.x());
}

CameraPath walk(const ClosedCurve& curve, const WalkStyle& style) {
  return [curve, style](double t) {
    const double s = style.speed * t;
    const double lap = kTurn * s / curve.length();
    const double heading = curve.heading(s);
    const Vector2 left(-std::sin(heading), std::cos(heading));
    const double step = kTurn * 0.95 * t;  // one cycle: two steps
    const double drift = 0.12 * std::sin(0.37 * lap) + 0.08 * std::sin(0.61 * lap + 1);
    const Vector2 xy = curve.position(s) + (drift + 0.012 * std::sin(step)) * left;
    const double z = style.eye_height + 0.018 * std::sin(2 * step) + 0.03 * std::sin(0.43 * lap);

    // Glances are tied to places (multiples of a lap), so that the next round sees most of them again.
    const double glance = 0.6 * std::sin(4 * lap) + 0.3 * std::sin(7 * lap + 0.8) + 0.1 * std::sin(2.3 * lap);
    const double yaw =
        heading + kDegree * (style.look_aside_deg * glance - style.outward_deg + 0.7 * std::sin(step + 0.4));
    const double pitch =
        kDegree * (style.pitch_deg + 2.5 * std::sin(3 * lap + 0.5) + 0.5 * std::sin(2 * step + 1));
    const double roll = kDegree * (0.8 * std::sin(step + 1.2) + 0.6 * std::sin(5 * lap));
    return looking({xy.x(), xy.y(), z}, yaw, pitch, roll);
  };
}

CameraPath flown(CameraPath path, double amplitude) {
  return [path = std::move(path), amplitude](double t) {
    // Frequencies [Hz] without a common multiple: the next round comes by otherwise.
    const auto swing = [t](double hertz, double phase) { return std::sin(kTurn * hertz * t + phase); };
    const Vector3 shift(0.25 * swing(0.41, 0) + 0.05 * swing(0.97, 2), 0.2 * swing(0.53, 1),
                        0.3 * swing(0.31, 2));
    const Vector3 turn(8 * swing(0.71, 0.5), 14 * swing(0.55, 0) + 8 * swing(1.13, 1),
                       12 * swing(0.47, 2) + 4 * swing(1.31, 0));
    return path(t) * SE3(SO3::exp(amplitude * kDegree * turn), amplitude * shift);
  };
}

}  // namespace twofold::synthetic
