#include "geometry/absolute_orientation.hpp"

#include <cmath>
#include "geometry/nearest_rotation.hpp"

namespace twofold {
namespace {

struct Alignment {
  Vector3 centroid_a, centroid_b;
  double spread_a, spread_b;  // summed squared distances from the centroids
  SO3 R_a_b;
};

Vector3 centroid(std::span<const Vector3> x) {
  Vector3 sum = Vector3::Zero();
  for (const Vector3& p : x) sum += p;
  return sum / static_cast<double>(x.size());
}

std::optional<Alignment> align(std::span<const Vector3> x_a, std::span<const Vector3> x_b) {
  constexpr double kCollinear = 1e-9;  // ratio of the second to the first singular value
  if (x_a.size() != x_b.size() || x_a.size() < 3) return std::nullopt;
  Alignment result{centroid(x_a), centroid(x_b), 0, 0, SO3()};
  Matrix3 H = Matrix3::Zero();
  for (std::size_t i = 0; i < x_a.size(); ++i) {
    const Vector3 y_a = x_a[i] - result.centroid_a;  // eq. 5.12
    const Vector3 y_b = x_b[i] - result.centroid_b;
    H += y_a * y_b.transpose();  // eq. 5.13
    result.spread_a += y_a.squaredNorm();
    result.spread_b += y_b.squaredNorm();
  }
  Vector3 s;
  const Matrix3 R_a_b = nearest_rotation(H, &s);
  if (!(s[1] > kCollinear * s[0])) return std::nullopt;  // also catches H = 0 and NaN
  result.R_a_b = SO3(R_a_b);
  return result;
}

}  // namespace

std::optional<SE3> align_rigid(std::span<const Vector3> x_a, std::span<const Vector3> x_b) {
  const auto a = align(x_a, x_b);
  if (!a) return std::nullopt;
  return SE3(a->R_a_b, a->centroid_a - a->R_a_b * a->centroid_b);
}

std::optional<Sim3> align_similarity(std::span<const Vector3> x_a, std::span<const Vector3> x_b) {
  const auto a = align(x_a, x_b);
  if (!a) return std::nullopt;
  const double s = std::sqrt(a->spread_a / a->spread_b);  // eq. 5.14
  return Sim3(s, a->R_a_b, a->centroid_a - s * (a->R_a_b * a->centroid_b));
}

}  // namespace twofold
