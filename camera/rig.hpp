#pragma once

#include <cmath>
#include <cstdint>
#include <limits>
#include <optional>

#include "camera/measurement.hpp"
#include "camera/pinhole.hpp"

namespace twofold {

enum class SensorKind : std::uint8_t { kMono, kStereo, kRgbd };

/// Standard deviations of what is measured in images, for tracker, mapper and loop closer alike; filters that
/// follow patches in other ways have their own.
struct MeasurementNoise {
  double sigma_px =
      0.5;  ///< of a sub-pixel match on pyramid level 0, as found on rendered views; doubles a level
  /// Of the virtual right coordinate that an RGB-D camera's depth becomes: constant in disparity, on any
  /// level.
  double depth_sigma_px = 0.7;
};

/// Rectified camera rig: the left (or only) camera and, for stereo and RGB-D, a right camera shifted by
/// `baseline`.
///
/// What it measures of a point is a StereoPixel. RGB-D depth becomes a virtual u_r = u_l - f b / depth
/// (6.5.3).
struct Rig {
  SensorKind kind = SensorKind::kStereo;
  PinholeCamera camera;       ///< both cameras of a rectified pair
  double baseline = 0;        ///< [m] > 0 for stereo and RGB-D
  double depth_unit = 0.001;  ///< RGB-D: metres per unit of the 16-bit depth image
  double depth_min = 0.3;     ///< nearer readings are holes [m]; stereo: of surfaces only
  double depth_max = 8.0;     ///< farther ones likewise
  /// Rolling shutter: from the exposure of the first row to that of the last [s]; 0: all rows at once.
  /// Nothing: nobody knows, and the tracker finds out.
  std::optional<double> readout;

  MeasurementNoise noise;

  static constexpr double kNoRight = std::numeric_limits<double>::quiet_NaN();

  /// Stereo measurement of a point in the left camera's frame [m]; x_c.z() must be positive  (eq. 3.8).
  [[nodiscard]] StereoPixel project(const Vector3& x_c) const {
    const double inv_z = 1.0 / x_c.z();
    return {camera.fx * x_c.x() * inv_z + camera.cx, camera.fy * x_c.y() * inv_z + camera.cy,
            camera.fx * (x_c.x() - baseline) * inv_z + camera.cx};
  }
  /// d project / d x_c  (B.1).
  [[nodiscard]] Matrix3 project_jacobian(const Vector3& x_c) const {
    const double inv_z = 1.0 / x_c.z();
    const double inv_z2 = inv_z * inv_z;
    Matrix3 J;
    J << camera.fx * inv_z, 0, -camera.fx * x_c.x() * inv_z2,  //
        0, camera.fy * inv_z, -camera.fy * x_c.y() * inv_z2,   //
        camera.fx * inv_z, 0, -camera.fx * (x_c.x() - baseline) * inv_z2;
    return J;
  }
  /// depth = f b / disparity (eq. 3.9, whose print has the fraction upside down); disparity must be positive.
  [[nodiscard]] double depth_from_disparity(double disparity) const {
    return camera.fx * baseline / disparity;
  }
  [[nodiscard]] double disparity_from_depth(double depth) const { return camera.fx * baseline / depth; }
  /// Standard deviation of a match on pyramid level `level` [level-0 px].
  [[nodiscard]] double sigma_px(int level) const { return std::ldexp(noise.sigma_px, level); }
  /// Diagonal of Lambda_z of a measurement taken on pyramid level `level` [1/px^2]; the third entry is 0
  /// without a right coordinate.
  [[nodiscard]] Eigen::Vector3f information(const StereoPixelF& z, int level) const;

  /// Point in the left camera's frame; z.x() - z.z() must be positive  (eq. 3.9).
  [[nodiscard]] Vector3 unproject(const StereoPixel& z) const {
    return camera.unproject(z.head<2>()) * depth_from_disparity(z.x() - z.z());
  }
};

}  // namespace twofold
