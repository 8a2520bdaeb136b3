#include "geometry/view_rotation.hpp"

#include <algorithm>
#include <limits>

#include "geometry/nearest_rotation.hpp"

namespace twofold {
namespace {

/// Rotation with b_i = R a_i in the least squares sense (Arun et al., without centroids: directions turn
/// about the origin).
SO3 fit_rotation(std::span<const Vector3> a, std::span<const Vector3> b, std::span<const int> indices) {
  Matrix3 H = Matrix3::Zero();
  for (const int i : indices) H += b[i].normalized() * a[i].normalized().transpose();
  return SO3(nearest_rotation(H));
}

/// Bisector of two directions, their difference, and what is perpendicular to both; not finite when they are
/// one.
Matrix3 frame_of_pair(const Vector3& first, const Vector3& second) {
  const Vector3 u = first.normalized(), v = second.normalized();
  Matrix3 axes;
  axes.col(0) = (u + v).normalized();
  axes.col(1) = (u - v) / (u - v).norm();
  axes.col(2) = axes.col(0).cross(axes.col(1));
  return axes;
}

constexpr int kPairLanes = 4;
using PairLanes = double __attribute__((vector_size(sizeof(double) * kPairLanes)));

double sum(const PairLanes& lanes) {
  return (lanes[0] + lanes[1]) + (lanes[2] + lanes[3]);
}

struct RotationEstimator {
  using Model = SO3;
  static constexpr int kSampleSize = 2;
  std::span<const Vector3> a, b;

  [[nodiscard]] int size() const { return static_cast<int>(std::min(a.size(), b.size())); }
  /// Of two pairs, least squares lay the bisectors and the planes onto each other.
  void fit(std::span<const int, 2> sample, std::vector<SO3>& models) const {
    const Matrix3 of_a = frame_of_pair(a[sample[0]], a[sample[1]]);
    const Matrix3 of_b = frame_of_pair(b[sample[0]], b[sample[1]]);
    if (of_a.allFinite() && of_b.allFinite()) models.emplace_back(Matrix3(of_b * of_a.transpose()));
  }
  [[nodiscard]] double squared_residual(const SO3& R_b_a, int i) const {
    return squared_rotation_residual(R_b_a, a[i], b[i]);
  }
  [[nodiscard]] ModelScore score(const SO3& R_b_a, double threshold2, double enough) const {
    const Matrix3 R = R_b_a.matrix();
    PairLanes inliers{}, score{};
    for (int first = 0; first < size() && sum(score) < enough; first += kPairLanes) {
      const PairLanes r2 = squared_residuals(R, first);
      const auto within = r2 <= threshold2;
      const auto used = PairLanes{0, 1, 2, 3} < static_cast<double>(size() - first);
      score += used ? (within ? r2 : PairLanes{} + threshold2) : PairLanes{};
      inliers += within && used ? PairLanes{} + 1 : PairLanes{};
    }
    return {sum(score), static_cast<int>(sum(inliers))};
  }

 private:
  /// Of four pairs; beyond the last one, that again.
  [[nodiscard]] PairLanes squared_residuals(const Matrix3& R, int first) const {
    const int end = size() - 1,
              n[4] = {first, std::min(first + 1, end), std::min(first + 2, end), std::min(first + 3, end)};
    const auto of = [&n](std::span<const Vector3> bearings, int k) {
      return PairLanes{bearings[n[0]][k], bearings[n[1]][k], bearings[n[2]][k], bearings[n[3]][k]};
    };
    const PairLanes x = of(a, 0), y = of(a, 1), z = of(a, 2), inv_b = 1 / of(b, 2);
    const PairLanes depth = R(2, 0) * x + R(2, 1) * y + R(2, 2) * z, inv_depth = 1 / depth;
    const PairLanes du = (R(0, 0) * x + R(0, 1) * y + R(0, 2) * z) * inv_depth - of(b, 0) * inv_b;
    const PairLanes dv = (R(1, 0) * x + R(1, 1) * y + R(1, 2) * z) * inv_depth - of(b, 1) * inv_b;
    constexpr double kInfinity = std::numeric_limits<double>::infinity();
    return depth > 0 ? du * du + dv * dv : PairLanes{} + kInfinity;
  }
};

}  // namespace

double squared_rotation_residual(const SO3& R_b_a, const Vector3& bearing_a, const Vector3& bearing_b) {
  const Vector3 turned = R_b_a * bearing_a;
  if (!(turned.z() > 0)) return std::numeric_limits<double>::infinity();
  return (turned.head<2>() / turned.z() - bearing_b.head<2>() / bearing_b.z()).squaredNorm();
}

std::optional<ViewRotation> estimate_view_rotation(std::span<const Vector3> bearings_a,
                                                   std::span<const Vector3> bearings_b,
                                                   const RansacOptions& options) {
  const RotationEstimator data{bearings_a, bearings_b};
  const auto found = ransac(data, options);
  if (!found) return std::nullopt;
  ViewRotation result{fit_rotation(bearings_a, bearings_b, found->inliers), {}};
  for (int i = 0; i < data.size(); ++i) {
    if (data.squared_residual(result.R_b_a, i) <= options.threshold * options.threshold)
      result.inliers.push_back(i);
  }
  return result;
}

std::optional<RoughViewRotation> rough_view_rotation(std::span<const Vector3> bearings_a,
                                                     std::span<const Vector3> bearings_b,
                                                     const RansacOptions& options, std::vector<SO3>& models) {
  const auto best = best_model(RotationEstimator{bearings_a, bearings_b}, options, models);
  return best ? std::optional(RoughViewRotation{best->model, best->inliers}) : std::nullopt;
}

}  // namespace twofold
