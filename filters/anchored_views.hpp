#pragma once

#include <vector>

#include "camera/measurement.hpp"
#include "camera/rig.hpp"
#include "geometry/se3.hpp"

namespace twofold {

/// That a view sees the point with this index, with the measurement; monocular rigs ignore u_r.
struct SeenPoint {
  int point = 0;
  StereoPixel pixel = StereoPixel::Zero();
};

/// Bundle adjustment of one anchor frame and a few others that see its points: the start of a monocular
/// filter (thesis 4.5.3). Unknown are the points, inverse depth in the anchor frame, and the other frames'
/// poses; what the anchor frame itself knows of each point is its prior. One camera leaves the scale free.
///
/// Points are eliminated one by one (thesis 3.3.5), so that a step costs O(N).
struct AnchoredViews {
  struct Point {
    Vector3 psi;        ///< present estimate
    Vector3 psi_prior;  ///< mean and
    Matrix3 prior;      ///< information of what the anchor frame measured
  };
  struct View {
    SE3 T_c_a;
    std::vector<SeenPoint> seen;
  };

  Rig rig;  ///< its noise.sigma_px is that of every measurement component
  std::vector<Point> points;
  std::vector<View> views;

  /// Levenberg-Marquardt until a step gains less of the cost than min_gain; the damping holds the free
  /// scale. False when points stay behind a camera. The cost never rises.
  [[nodiscard]] bool minimise(int max_iterations, double min_gain = 1e-6);
  /// Squared whitened error; infinity when a point is behind a camera.
  [[nodiscard]] double cost() const;
  /// Lets the first view be one unit of length from the anchor. False when it stands there.
  [[nodiscard]] bool normalise_scale();
  /// Gauss-Newton information of [points | poses of the views], left perturbations (v, omega). Empty when a
  /// point is behind a camera.
  [[nodiscard]] Eigen::MatrixXd information() const;

 private:
  struct Equations;
  [[nodiscard]] bool linearise(Equations& equations) const;
  template <int kRows>
  [[nodiscard]] bool add_view(std::size_t v, Equations& equations) const;
  [[nodiscard]] std::vector<SE3> poses() const;
  void move(const Eigen::VectorXd& poses_step, const std::vector<Vector3>& points_step);
};

}  // namespace twofold
