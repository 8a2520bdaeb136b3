#pragma once

#include <array>
#include <optional>

#include "camera/pinhole.hpp"
#include "geometry/types.hpp"

namespace twofold {

/// What the regions of an image, 6 by 4 of them, say of a pose, each by itself. Measurements in fewer than
/// half of the regions say nothing: nullopt, as for a singular information.
class RegionSums {
 public:
  explicit RegionSums(const PinholeCamera& camera) : width_(camera.width), height_(camera.height) { clear(); }

  void clear();
  /// One measurement at `uv` (level-0 pixels): its part of J^T W J and of the gradient J^T W e.
  void add(const Eigen::Vector2f& uv, const Matrix6& information, const Vector6& gradient);

  /// Sum of y J^T W J, y a measurement's row below the image's centre in image heights, -1/2 to 1/2. Times
  /// the camera's velocity (v, omega) and the time its rows take to be read [s]: J^T W e of what that rolling
  /// shutter displaces measurements by.
  [[nodiscard]] const Matrix6& by_rows() const { return by_rows_; }
  /// Factor by which errors that the measurements of a region share make the covariance larger than
  /// C = information^-1, the inverse of J^T W J of all: with g_r the gradient of region r it is C S C,
  /// S = sum g_r g_r^T, whatever the errors are within a region (the sandwich of Huber 1967, clusters of
  /// Liang and Zeger 1986), and of that the size, tr(S C) / 6 k / (k - 6); six of k regions are lost to the
  /// pose. What all regions share does not show.
  [[nodiscard]] std::optional<double> variance_factor(const Matrix6& information) const;
  /// The covariance from how far the pose moves when each region is left out: (k - 1) / k sum d_r d_r^T
  /// (jackknife of clusters, Bell and McCaffrey 2002; one Gauss-Newton step each). A measurement that carries
  /// the pose off by itself leaves no residual that would tell, and claims to be exact; leaving it out shows
  /// it. A region without which the pose is not determined is left out of the sum.
  [[nodiscard]] std::optional<Matrix6> jackknife(const Matrix6& information) const;

 private:
  static constexpr int kColumns = 6, kRows = 4;
  struct Region {
    Matrix6 information;
    Vector6 gradient;
    bool seen;
  };
  int width_, height_;
  std::array<Region, kColumns * kRows> regions_;
  Matrix6 by_rows_;
};

}  // namespace twofold
