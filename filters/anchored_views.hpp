#pragma once

#include <Eigen/Core>
#include <vector>

#include "camera/pinhole.hpp"
#include "geometry/se3.hpp"

namespace twofold {

/// Bundle adjustment of one anchor frame of one camera and a few others, each of which sees all its points:
/// the start of a monocular filter (thesis 4.5.3). Unknown are the points, inverse depth in the anchor frame,
/// and the other frames' poses; what the anchor frame itself knows of each point is its prior. The scale is
/// free.
///
/// Points are eliminated (thesis 3.3.5), so that a step costs O(N) of N points; the arithmetic takes four at
/// a time.
struct AnchoredViews {
  struct Point {
    Vector3 psi;        ///< present estimate
    Vector3 psi_prior;  ///< mean and
    Matrix3 prior;      ///< information of what the anchor frame measured
  };
  struct View {
    SE3 T_c_a;
    std::vector<Vector2> pixels;  ///< where it sees the points, in step with them
  };

  PinholeCamera camera;
  double sigma_px = 1;  ///< of every measurement component, > 0
  std::vector<Point> points;
  std::vector<View> views;

  /// Levenberg-Marquardt until a step gains less of the cost than min_gain; the damping holds the free
  /// scale. False when points stay behind a camera. The cost never rises.
  [[nodiscard]] bool minimise(int max_iterations, double min_gain = 1e-6);
  /// Squared whitened error; infinity when a point is behind a camera.
  [[nodiscard]] double cost() const;
  /// Of each point, the largest squared whitened error that a view or its prior has; infinity behind a
  /// camera.
  [[nodiscard]] std::vector<double> worst_errors() const;
  /// Lets the first view be one unit of length from the anchor. False when it stands there.
  [[nodiscard]] bool normalise_scale();
  /// Gauss-Newton information of [points | poses of the views], left perturbations (v, omega). Empty when a
  /// point is behind a camera.
  [[nodiscard]] Eigen::MatrixXd information() const;
};

}  // namespace twofold
