#pragma once

#include <string>
#include <vector>

#include "geometry/se3.hpp"
#include "geometry/triangle_mesh.hpp"

namespace twofold {

inline constexpr double kMostThresholds = 10;  ///< distances are cut at so many

struct SurfaceComparisonOptions {
  double threshold = 0.01;  ///< what counts as near, for completeness, precision and F-score [m] > 0
  double spacing = 0.005;   ///< of the points that are compared [m] > 0

  /// Empty when valid; otherwise names the field, the rule and the value.
  [[nodiscard]] std::string invalid_reason() const;
};

struct DistanceStatistics {
  std::size_t points = 0;
  double mean = 0, median = 0, p95 = 0, rmse = 0;  ///< [m]; distances are cut at kMostThresholds
  double near = 0;                                 ///< share of points within the threshold
};

/// How far two surfaces lie apart.
struct SurfaceComparison {
  DistanceStatistics accuracy;       ///< of the estimate's points to the true surface; near: precision
  DistanceStatistics completeness;   ///< of the true surface's points to the estimate; near: recall
  double f_score = 0;                ///< harmonic mean of precision and recall
  std::vector<float> vertex_errors;  ///< of each vertex of the estimate, to the true surface [m]
};

/// Rigid motion T_w_e that brings an estimate onto the true surface, from a first one that is off by less
/// than `reach` [m]: least squares over the distances of points, 5 cm apart, to the planes of the triangles
/// nearest to them, where these are within a reach that shrinks from step to step to 2 cm (iterated closest
/// points, Chen and Medioni, 1992). A thing of 10 cm has some two dozen points. Neither mesh may be empty.
[[nodiscard]] SE3 fit_surface(const TriangleMesh& estimate, const SE3& T_w_e, const TriangleMesh& truth,
                              double reach = 0.25);

/// Compares an estimate, moved by T_w_e, with the true surface. `seen` is the part of the truth that
/// completeness asks for: what no camera saw cannot be missing. Neither mesh may be empty.
[[nodiscard]] SurfaceComparison compare_surfaces(const TriangleMesh& estimate, const SE3& T_w_e,
                                                 const TriangleMesh& truth, const TriangleMesh& seen,
                                                 const SurfaceComparisonOptions& options = {});

}  // namespace twofold
