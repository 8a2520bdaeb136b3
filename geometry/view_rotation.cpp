#include "geometry/view_rotation.hpp"

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

struct RotationEstimator {
  using Model = SO3;
  static constexpr int kSampleSize = 2;
  std::span<const Vector3> a, b;

  [[nodiscard]] int size() const { return static_cast<int>(std::min(a.size(), b.size())); }
  void fit(std::span<const int, 2> sample, std::vector<SO3>& models) const {
    models.push_back(fit_rotation(a, b, sample));
  }
  [[nodiscard]] double squared_residual(const SO3& R_b_a, int i) const {
    return squared_rotation_residual(R_b_a, a[i], b[i]);
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
