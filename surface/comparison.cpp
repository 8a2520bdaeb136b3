#include "surface/comparison.hpp"

#include <algorithm>
#include <cmath>
#include <span>

#include "base/check.hpp"
#include "base/option_check.hpp"
#include "geometry/symmetric_solve.hpp"
#include "surface/triangle_grid.hpp"

namespace twofold {
namespace {

DistanceStatistics statistics(const std::vector<MeshPoint>& samples, const TriangleGrid& surface,
                              double threshold) {
  std::vector<float> distances;
  distances.reserve(samples.size());
  DistanceStatistics s;
  s.points = samples.size();
  if (samples.empty()) return s;
  double sum = 0, squares = 0;
  std::size_t near = 0;
  for (const MeshPoint& sample : samples) {
    const float d = surface.distance(sample.position);
    distances.push_back(d);
    sum += d;
    squares += static_cast<double>(d) * d;
    near += d <= threshold;
  }
  std::sort(distances.begin(), distances.end());
  const auto count = static_cast<double>(samples.size());
  s.mean = sum / count;
  s.rmse = std::sqrt(squares / count);
  s.median = distances[distances.size() / 2];
  s.p95 = distances[distances.size() * 95 / 100];
  s.near = static_cast<double>(near) / count;
  return s;
}

}  // namespace

SE3 fit_surface(const TriangleMesh& estimate, const SE3& T_w_e, const TriangleMesh& truth, double reach) {
  constexpr int kSteps = 15;
  constexpr float kSpacing = 0.05f;     // of the points [m]
  constexpr double kLeastReach = 0.02;  // in the end [m]
  const TriangleGrid surface(truth, static_cast<float>(reach));
  const std::vector<MeshPoint> samples = sample_surface(estimate, kSpacing);
  SE3 T = T_w_e;
  double within = reach;
  for (int step = 0; step < kSteps; ++step) {
    Matrix6 H = 1e-9 * Matrix6::Identity();
    Vector6 g = Vector6::Zero();
    for (const MeshPoint& sample : samples) {
      const Vector3 x = T * Vector3(sample.position.cast<double>());
      const auto plane = surface.nearest_plane(x.cast<float>());
      if (!plane || plane->distance > within) continue;
      const Vector3 n = plane->normal.cast<double>();
      Vector6 J;  // of n . x by (v, omega), left perturbation
      J << n, x.cross(n);
      H += J * J.transpose();
      g += J * (n.dot(x) - plane->offset);
    }
    const Vector6 delta = -solve_symmetric(H, g);
    T = SE3::exp(delta) * T;
    within = std::max(kLeastReach, 0.8 * within);
  }
  return T;
}

std::string SurfaceComparisonOptions::invalid_reason() const {
  return OptionCheck().above("threshold", threshold, 0).above("spacing", spacing, 0).reason();
}

SurfaceComparison compare_surfaces(const TriangleMesh& estimate, const SE3& T_w_e, const TriangleMesh& truth,
                                   const TriangleMesh& seen, const SurfaceComparisonOptions& options) {
  TWOFOLD_CHECK(options.invalid_reason().empty(), "options of the comparison");
  TriangleMesh moved;
  moved.triangles = estimate.triangles;
  moved.positions.reserve(estimate.positions.size());
  for (const Eigen::Vector3f& x : estimate.positions)
    moved.positions.emplace_back((T_w_e * Vector3(x.cast<double>())).cast<float>());
  const auto reach = static_cast<float>(kMostThresholds * options.threshold);
  const auto spacing = static_cast<float>(options.spacing);
  const TriangleGrid true_surface(truth, reach);
  SurfaceComparison result;
  result.accuracy = statistics(sample_surface(moved, spacing), true_surface, options.threshold);
  result.completeness =
      statistics(sample_surface(seen, spacing), TriangleGrid(moved, reach), options.threshold);
  const double sum = result.accuracy.near + result.completeness.near;
  if (sum > 0) result.f_score = 2 * result.accuracy.near * result.completeness.near / sum;
  result.vertex_errors.reserve(moved.positions.size());
  for (const Eigen::Vector3f& x : moved.positions) result.vertex_errors.push_back(true_surface.distance(x));
  return result;
}

}  // namespace twofold
