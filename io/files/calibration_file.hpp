#pragma once

#include <filesystem>
#include <optional>
#include <string>

#include "camera/calibration.hpp"

namespace twofold {

/// Reads a calibration; the form is recognised by what the file holds  (docs/calibration.md):
///
///   own YAML          top-level key `cameras`
///   Kalibr camchain   top-level keys cam0, cam1
///   EuRoC sensor.yaml top-level key camera_model or T_BS: one camera
///   OpenCV, ROS       top-level key camera_matrix: one camera
///   OpenLORIS         top-level key d400_color_optical_frame, of sensors.yaml: one camera
///   KITTI calib.txt   lines "P0: twelve numbers"; has no image size: width and height stay 0
///   ETH3D SLAM        one line "fx fy cx cy"; without an image size, too
///   EuRoC folder      cam0/sensor.yaml, and cam1/sensor.yaml of a pair, in it or in mav0 in it
///
/// The result is not yet checked as a whole (see expect_valid), because a size may have to come from the
/// images. Throws IoError naming file, key and what is wrong; keys the own form does not know are errors.
[[nodiscard]] Calibration read_calibration(const std::filesystem::path& file);

/// The one line "fx fy cx cy" of ETH3D SLAM's calibration.txt; nothing when the file has anything else.
/// Throws IoError when it cannot be read.
[[nodiscard]] std::optional<Calibration> read_plain_intrinsics(const std::filesystem::path& file);

/// FOLDER/mav0/SENSOR/sensor.yaml where there is such a folder, else FOLDER/SENSOR/sensor.yaml.
[[nodiscard]] std::filesystem::path euroc_sensor_file(const std::filesystem::path& folder,
                                                      const std::string& sensor);
/// EuRoC keeps a file a camera. Poses of the cameras in the body come from T_BS. A pair of rectified images
/// says so by its numbers alone: equal cameras, no distortion, a pure shift.
[[nodiscard]] Calibration read_euroc_calibration(const std::filesystem::path& cam0,
                                                 const std::filesystem::path& cam1);

/// One camera of an EuRoC rig and its pose in the body frame.
struct EurocCamera {
  CameraModel model;
  SE3 T_b_c;
  double rate_hz = 0;
  std::optional<double> readout;  ///< as of Calibration
};
/// T_BS alone, of a sensor that need not be a camera.
[[nodiscard]] SE3 read_euroc_sensor_pose(const std::filesystem::path& file);
[[nodiscard]] EurocCamera read_euroc_camera(const std::filesystem::path& file);

/// T_b_c of the left camera in the body (the IMU), from a file of one of the forms above: T_BS of EuRoC's
/// sensor.yaml, or the inverse of T_cam_imu of Kalibr's camchain. Nothing where it is not said. Throws
/// IoError.
[[nodiscard]] std::optional<SE3> read_camera_in_body(const std::filesystem::path& file);

/// A lens as `model` or `distortion_model` of these files names it: none, radtan, equidistant, rational; ds,
/// which is a `camera_model`.
[[nodiscard]] const char* distortion_name(DistortionModel model);

/// Fills in a size that the calibration file did not state. Throws IoError with the file's name when the
/// camera's centre lies outside of such an image: the numbers are of larger ones.
void set_missing_size(const std::filesystem::path& file, int width, int height, Calibration* calibration);

/// Throws IoError with the file's name when the calibration cannot be used (negative focal length, size
/// missing, ...).
void expect_valid(const std::filesystem::path& file, const Calibration& calibration);

/// How a calibration came about; kept in the file for people and ignored when read.
struct CalibrationQuality {
  std::string board;
  int views = 0;
  double rms_px = 0;
  double focal_std_px = 0;             ///< the largest of all fx, fy
  std::optional<double> baseline_std;  ///< stereo [m]
};

/// Writes the own form; only mono and stereo. Throws IoError when the file cannot be written.
void write_calibration(const std::filesystem::path& file, const Calibration& calibration,
                       const CalibrationQuality& quality);

}  // namespace twofold
