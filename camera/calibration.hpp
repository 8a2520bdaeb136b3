#pragma once

#include <optional>
#include <string>

#include "camera/camera_model.hpp"
#include "camera/rig.hpp"
#include "geometry/se3.hpp"

namespace twofold {

/// No rolling shutter takes longer from the first row to the last [s].
constexpr double kLongestReadout = 0.5;

/// A camera that takes depth images beside the one that takes the others.
struct DepthCamera {
  CameraModel model;
  SE3 T_left_depth;  ///< its pose in the left (the only other) camera [m]
};

/// No pair that anything carries stands farther apart [m]: a longer baseline is in millimetres.
constexpr double kLongestBaseline = 20;

/// What a calibration file says about a sensor, before rectification. `Rectifier` turns it into a Rig.
struct Calibration {
  SensorKind kind = SensorKind::kStereo;
  CameraModel left;   ///< left or only camera
  CameraModel right;  ///< stereo only
  /// Stereo only: pose of the left camera in the right one [m]. A rectified pair with baseline b has (I, (-b,
  /// 0, 0)).
  SE3 T_right_left;
  /// Images are undistorted and, for stereo, row-aligned already: both cameras must be equal pinholes without
  /// distortion and T_right_left a pure shift along -x.
  bool already_rectified = false;
  double fps = 0;  ///< nominal frame rate [Hz]; 0 = unknown
  /// Rolling shutter: from the exposure of the first row to that of the last [s], 0 to kLongestReadout, and
  /// not longer than a frame takes where `fps` is known; 0: all rows at once.
  /// Nothing: nobody knows, and the tracker finds out.
  std::optional<double> readout;

  double depth_unit = 0.001;       ///< metres per unit of the 16-bit depth image, > 0; stereo: of a surface's
  bool depth_unit_stated = false;  ///< the file says it; else a layout may know better
  double depth_min = 0.3;          ///< nearer readings are holes [m], > 0; stereo: of surfaces only
  double depth_max = 8.0;          ///< farther readings likewise [m]
  double virtual_baseline = 0.08;  ///< RGB-D: baseline of the virtual right camera (thesis 6.5.3) [m], > 0
  /// RGB-D: depth images are depth_camera's; else they are the left camera's, pixel by pixel.
  bool depth_apart = false;
  DepthCamera depth_camera;

  /// Empty when valid; otherwise names the field, the rule and the value.
  [[nodiscard]] std::string invalid_reason() const;
};

}  // namespace twofold
