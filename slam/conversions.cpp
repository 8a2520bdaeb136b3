#include "slam/conversions.hpp"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <string>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "camera/camera_info.hpp"

namespace twofold {
namespace {

void expect(bool rule, const char* field, const char* what, double value) {
  if (!rule) throw std::invalid_argument(fmt::format("rig.{} must be {}, is {}", field, what, value));
}

bool positive(double value) {
  return std::isfinite(value) && value > 0;
}

Sensor sensor_of(SensorKind kind) {
  switch (kind) {
    case SensorKind::kStereo:
      return Sensor::kStereo;
    case SensorKind::kRgbd:
      return Sensor::kRgbd;
    case SensorKind::kMono:
      break;
  }
  return Sensor::kMono;
}

SensorKind kind_of(Sensor sensor) {
  switch (sensor) {
    case Sensor::kStereo:
      return SensorKind::kStereo;
    case Sensor::kRgbd:
      return SensorKind::kRgbd;
    case Sensor::kMono:
      return SensorKind::kMono;
  }
  throw std::invalid_argument("rig.sensor must be one of Sensor's values");
}

CameraInfoMessage message_of(const CameraInfo& info) {
  return {static_cast<std::uint32_t>(info.width),
          static_cast<std::uint32_t>(info.height),
          info.distortion_model,
          info.D,
          info.K,
          info.R,
          info.P};
}

template <class T>
T usable(tl::expected<T, std::string> found, const char* whose) {
  if (!found) throw std::invalid_argument(std::string(whose) + found.error());
  return *std::move(found);
}

CameraModel model_of(const CameraInfo& info, const char* whose) {
  const auto& K = info.K;
  if (K[1] != 0 || K[3] != 0 || K[6] != 0 || K[7] != 0 || K[8] != 1)
    throw std::invalid_argument(
        fmt::format("{}K must be [fx, 0, cx, 0, fy, cy, 0, 0, 1], is [{}]", whose, fmt::join(K, ", ")));
  return usable(raw_camera(message_of(info)), whose);
}

Calibration pair_of(const CameraInfo& left, const CameraInfo& right, const SE3& T_right_left) {
  Calibration calibration;
  calibration.kind = SensorKind::kStereo;
  calibration.left = model_of(left, "left camera: ");
  calibration.right = model_of(right, "right camera: ");
  calibration.T_right_left = T_right_left;
  return calibration;
}

CameraModel model_of(const CalibratedCamera& camera) {
  CameraModel model;
  model.pinhole = {camera.fx, camera.fy, camera.cx, camera.cy, camera.width, camera.height};
  model.distortion.model = DistortionModel::kRadTan;
  std::copy(camera.distortion.begin(), camera.distortion.end(), model.distortion.coefficients.begin());
  return model;
}

}  // namespace

Pose to_pose(const SE3& T_a_b) {
  const Eigen::Quaterniond& q = T_a_b.so3().quaternion();
  const Vector3& t = T_a_b.translation();
  return {{q.x(), q.y(), q.z(), q.w()}, {t.x(), t.y(), t.z()}};
}

SE3 to_se3(const Pose& T_a_b) {
  const auto& q = T_a_b.q;
  return {SO3(Eigen::Quaterniond(q[3], q[0], q[1], q[2])), Vector3(T_a_b.t[0], T_a_b.t[1], T_a_b.t[2])};
}

bool is_rigid_motion(const Pose& T_a_b) {
  constexpr double kTolerance = 0.01;  // of the quaternion's length
  const auto& [x, y, z, w] = T_a_b.q;
  const double length = std::hypot(std::hypot(x, y), std::hypot(z, w));
  return std::isfinite(T_a_b.t[0]) && std::isfinite(T_a_b.t[1]) && std::isfinite(T_a_b.t[2]) &&
         std::abs(length - 1) <= kTolerance;
}

CameraRig to_camera_rig(const Rig& rig) {
  const PinholeCamera& c = rig.camera;
  return {sensor_of(rig.kind), c.width,        c.height,      c.fx,          c.fy,       c.cx, c.cy,
          rig.baseline,        rig.depth_unit, rig.depth_min, rig.depth_max, rig.readout};
}

Rig to_rig(const CameraRig& rig) {
  constexpr int kMost = 16384;  // more than any camera has, and far from what OpenCV's images can hold
  expect(rig.width > 0 && rig.width <= kMost, "width", "1 to 16384", rig.width);
  expect(rig.height > 0 && rig.height <= kMost, "height", "1 to 16384", rig.height);
  expect(positive(rig.fx), "fx", "> 0", rig.fx);
  expect(positive(rig.fy), "fy", "> 0", rig.fy);
  expect(std::isfinite(rig.cx), "cx", "a number", rig.cx);
  expect(std::isfinite(rig.cy), "cy", "a number", rig.cy);
  Rig inside;
  inside.kind = kind_of(rig.sensor);
  inside.camera = {rig.fx, rig.fy, rig.cx, rig.cy, rig.width, rig.height};
  if (rig.sensor != Sensor::kMono) {
    const bool left_out = rig.sensor == Sensor::kRgbd && rig.baseline == 0;
    inside.baseline = left_out ? Calibration{}.virtual_baseline : rig.baseline;
    expect(positive(inside.baseline) && inside.baseline <= kLongestBaseline, "baseline", "in (0, 20]",
           rig.baseline);
  }
  if (rig.readout)
    expect(*rig.readout >= 0 && *rig.readout <= kLongestReadout, "readout", "0 to 0.5", *rig.readout);
  inside.readout = rig.readout;
  if (rig.sensor == Sensor::kMono) return inside;
  expect(positive(rig.depth_unit), "depth_unit", "> 0", rig.depth_unit);
  expect(positive(rig.depth_min), "depth_min", "> 0", rig.depth_min);
  expect(std::isfinite(rig.depth_max) && rig.depth_max > rig.depth_min, "depth_max", "finite and > depth_min",
         rig.depth_max);
  inside.depth_unit = rig.depth_unit;
  inside.depth_min = rig.depth_min;
  inside.depth_max = rig.depth_max;
  return inside;
}

Calibration to_calibration(const CameraInfo& camera, Sensor sensor) {
  if (sensor != Sensor::kMono && sensor != Sensor::kRgbd)
    throw std::invalid_argument("one camera is Sensor::kMono or kRgbd; a stereo pair needs two");
  Calibration calibration;
  calibration.kind = sensor == Sensor::kRgbd ? SensorKind::kRgbd : SensorKind::kMono;
  calibration.left = model_of(camera, "left camera: ");
  return calibration;
}

Calibration to_calibration(const CameraInfo& left, const CameraInfo& right) {
  const CameraInfoMessage of_left = message_of(left), of_right = message_of(right);
  const Vector3 t = usable(rectified_translation(of_left, of_right), "pair: ");
  const SE3 T_rect_left(usable(rectifying_rotation(of_left), "left camera: "), Vector3::Zero());
  const SE3 T_rect_right(usable(rectifying_rotation(of_right), "right camera: "), Vector3::Zero());
  return pair_of(left, right, T_rect_right.inverse() * SE3(SO3(), t) * T_rect_left);
}

Calibration to_calibration(const CameraInfo& left, const CameraInfo& right, const Pose& T_right_left) {
  if (!is_rigid_motion(T_right_left))
    throw std::invalid_argument(
        fmt::format("T_right_left must have finite numbers and a unit quaternion, is q [{}], t [{}]",
                    fmt::join(T_right_left.q, ", "), fmt::join(T_right_left.t, ", ")));
  return pair_of(left, right, to_se3(T_right_left));
}

Calibration to_calibration(const BoardCalibration& board) {
  Calibration calibration;
  calibration.kind = board.right ? SensorKind::kStereo : SensorKind::kMono;
  calibration.left = model_of(board.left);
  if (!board.right) return calibration;
  calibration.right = model_of(*board.right);
  calibration.T_right_left = to_se3(board.T_right_left);
  return calibration;
}

Pose compose(const Pose& T_a_b, const Pose& T_b_c) {
  return to_pose(to_se3(T_a_b) * to_se3(T_b_c));
}

Pose inverse(const Pose& T_a_b) {
  return to_pose(to_se3(T_a_b).inverse());
}

std::array<double, 3> transform(const Pose& T_a_b, const std::array<double, 3>& p_b) {
  const Vector3 p_a = to_se3(T_a_b) * Vector3(p_b[0], p_b[1], p_b[2]);
  return {p_a.x(), p_a.y(), p_a.z()};
}

}  // namespace twofold
