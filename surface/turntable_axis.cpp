#include "surface/turntable_axis.hpp"

#include <Eigen/Cholesky>
#include <cmath>
#include <vector>

namespace twofold {
namespace {

constexpr double kStride = 0.35;  // [rad] between the two poses of a pair: enough to tell where the axis is
constexpr double kLeastTurn = 0.17;  // [rad] from the first pose to the last: less says nothing of the rate

struct Pair {
  std::size_t from, to;
};

/// Pairs of poses about kStride apart, each pose the beginning of one at most.
std::vector<Pair> pairs_of(std::span<const SE3> T_w_c) {
  std::vector<Pair> pairs;
  std::size_t to = 0;
  for (std::size_t from = 0; from < T_w_c.size(); ++from) {
    to = std::max(to, from + 1);
    const auto angle = [&](std::size_t n) {
      return (T_w_c[n].so3() * T_w_c[from].so3().inverse()).log().norm();
    };
    while (to < T_w_c.size() && angle(to) < kStride) ++to;
    if (to == T_w_c.size()) break;
    pairs.push_back({from, to});
  }
  return pairs;
}

/// Angle of all steps about the direction.
double angle_about(const Vector3& direction, std::span<const SE3> T_w_c) {
  double angle = 0;
  for (std::size_t n = 1; n < T_w_c.size(); ++n)
    angle += direction.dot((T_w_c[n].so3() * T_w_c[n - 1].so3().inverse()).log());
  return angle;
}

}  // namespace

std::optional<TurntableAxis> fit_turntable_axis(std::span<const double> seconds, std::span<const SE3> T_w_c,
                                                const Vector3& up) {
  const std::vector<Pair> pairs = pairs_of(T_w_c);
  if (pairs.size() < 2 || seconds.size() != T_w_c.size()) return std::nullopt;
  TurntableAxis axis;
  Vector3 sum = Vector3::Zero();
  for (const Pair& p : pairs) {
    const Vector3 turn = (T_w_c[p.to].so3() * T_w_c[p.from].so3().inverse()).log();
    sum += sum.dot(turn) < 0 ? Vector3(-turn) : turn;  // the plate may have turned back
  }
  if (sum.norm() == 0) return std::nullopt;
  axis.direction = sum.normalized();
  if (axis.direction.dot(up) < 0) axis.direction = -axis.direction;
  const double turned = angle_about(axis.direction, T_w_c);
  if (std::abs(turned) < kLeastTurn) return std::nullopt;
  // The camera turns about the object the other way than the object before the camera.
  axis.turned = -turned;
  axis.rate = axis.turned / (seconds.back() - seconds.front());
  Vector3 mean = Vector3::Zero();
  for (const SE3& T : T_w_c) mean += T.translation() / static_cast<double>(T_w_c.size());
  // Along the axis any point will do: the one beside the cameras.
  Matrix3 A = axis.direction * axis.direction.transpose();
  Vector3 b = axis.direction * axis.direction.dot(mean);
  for (const Pair& p : pairs) {
    const Matrix3 dR = (T_w_c[p.to].so3() * T_w_c[p.from].so3().inverse()).matrix();
    const Matrix3 J = Matrix3::Identity() - dR;
    A += J.transpose() * J;
    b += J.transpose() * (T_w_c[p.to].translation() - dR * T_w_c[p.from].translation());
  }
  axis.point = A.ldlt().solve(b);
  double squares = 0;
  for (const Pair& p : pairs) {
    const SO3 dR = T_w_c[p.to].so3() * T_w_c[p.from].so3().inverse();
    const Vector3 turned_on = axis.point + dR * Vector3(T_w_c[p.from].translation() - axis.point);
    squares += (turned_on - T_w_c[p.to].translation()).squaredNorm();
  }
  axis.deviation = std::sqrt(squares / static_cast<double>(pairs.size()));
  return axis;
}

}  // namespace twofold
