#include "slam/conversions.hpp"

#include <cmath>
#include <stdexcept>
#include <string>

#include <fmt/format.h>

#include "camera/calibration.hpp"

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
