#include "geometry/absolute_orientation.hpp"

#include <array>
#include <cmath>

#include "geometry/nearest_rotation.hpp"

namespace twofold {
namespace {

struct PointAlignment {
  Vector3 centroid_a, centroid_b;
  double spread_a, spread_b;  // summed squared distances from the centroids
  SO3 R_a_b;
};

Vector3 centroid(std::span<const Vector3> x) {
  Vector3 sum = Vector3::Zero();
  for (const Vector3& p : x) sum += p;
  return sum / static_cast<double>(x.size());
}

constexpr double kCollinear = 1e-9;  // ratio of the second to the first singular value

/// A triangle's plane: two axes in it, so that its corners turn from the first to the second, and its normal.
Matrix3 triangle_axes(const Vector3& centroid, std::span<const Vector3> x) {
  Matrix3 axes;
  axes.col(0) = (x[0] - centroid).normalized();
  axes.col(2) = (x[1] - x[0]).cross(x[2] - x[0]).normalized();
  axes.col(1) = axes.col(2).cross(axes.col(0));
  return axes;
}

/// Of three points in each frame: their planes fall upon each other, and H in the plane, whose determinant is
/// positive as both triangles turn the same way, is decomposed in closed form. A tenth of the general one's
/// time.
std::optional<SO3> rotation_of_triangles(const Matrix3& H, const Vector3& centroid_a,
                                         std::span<const Vector3> x_a, const Vector3& centroid_b,
                                         std::span<const Vector3> x_b) {
  const Matrix3 axes_a = triangle_axes(centroid_a, x_a), axes_b = triangle_axes(centroid_b, x_b);
  const Eigen::Matrix2d in_plane = axes_a.leftCols<2>().transpose() * H * axes_b.leftCols<2>();
  // The product of the singular values, and the sum of their squares.
  if (!(in_plane.determinant() > kCollinear * in_plane.squaredNorm())) return std::nullopt;
  const Vector2 turn = Vector2(in_plane(0, 0) + in_plane(1, 1), in_plane(1, 0) - in_plane(0, 1)).normalized();
  Matrix3 turned = axes_a;
  turned.col(0) = turn.x() * axes_a.col(0) + turn.y() * axes_a.col(1);
  turned.col(1) = turn.x() * axes_a.col(1) - turn.y() * axes_a.col(0);
  return SO3(Matrix3(turned * axes_b.transpose()));
}

std::optional<PointAlignment> align(std::span<const Vector3> x_a, std::span<const Vector3> x_b) {
  if (x_a.size() != x_b.size() || x_a.size() < 3) return std::nullopt;
  PointAlignment result{centroid(x_a), centroid(x_b), 0, 0, SO3()};
  Matrix3 H = Matrix3::Zero();
  for (std::size_t i = 0; i < x_a.size(); ++i) {
    const Vector3 y_a = x_a[i] - result.centroid_a;  // eq. 5.12
    const Vector3 y_b = x_b[i] - result.centroid_b;
    H += y_a * y_b.transpose();  // eq. 5.13
    result.spread_a += y_a.squaredNorm();
    result.spread_b += y_b.squaredNorm();
  }
  if (x_a.size() == 3) {
    const auto R_a_b = rotation_of_triangles(H, result.centroid_a, x_a, result.centroid_b, x_b);
    if (!R_a_b) return std::nullopt;
    result.R_a_b = *R_a_b;
    return result;
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
