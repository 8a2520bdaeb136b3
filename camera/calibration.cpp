#include "camera/calibration.hpp"

#include <cmath>

namespace twofold {
namespace {

std::string invalid_stereo(const Calibration& c) {
  if (const auto reason = c.right.invalid_reason(); !reason.empty()) return "right camera: " + reason;
  if (!c.T_right_left.translation().allFinite() || !c.T_right_left.so3().quaternion().coeffs().allFinite()) {
    return "T_right_left is not finite";
  }
  if (!((c.T_right_left.so3() * Vector3::UnitZ()).z() > 0))
    return "T_right_left: the right camera must look the same way as the left one";
  const Vector3 right_in_left = c.T_right_left.inverse().translation();
  if (!(right_in_left.norm() > 1e-4)) return "T_right_left: the baseline must be longer than 0.1 mm";
  if (right_in_left.norm() > kLongestBaseline)
    return "T_right_left: the baseline is " + std::to_string(right_in_left.norm()) +
           " m: was it given in millimetres?";
  if (right_in_left.x() < 0.5 * right_in_left.norm()) {
    return "T_right_left: the right camera must lie mainly along +x of the left one; its position there is "
           "(" +
           std::to_string(right_in_left.x()) + ", " + std::to_string(right_in_left.y()) + ", " +
           std::to_string(right_in_left.z()) + ") m";
  }
  return {};
}

std::string invalid_readout(double readout, double fps) {
  if (!(readout >= 0 && readout <= kLongestReadout))
    return "readout must be within 0 and " + std::to_string(kLongestReadout) + " s, is " +
           std::to_string(readout);
  constexpr double kRounding = 1.05;  // rates are stated as 30 for 29.97
  if (readout * fps > kRounding)
    return "readout must not be longer than a frame takes (" + std::to_string(1 / fps) + " s), is " +
           std::to_string(readout);
  return {};
}

std::string invalid_depth_camera(const DepthCamera& camera) {
  if (const auto reason = camera.model.invalid_reason(); !reason.empty()) return "depth camera: " + reason;
  const SE3& T = camera.T_left_depth;
  if (!T.translation().allFinite() || !T.so3().quaternion().coeffs().allFinite())
    return "T_left_depth is not finite";
  return {};
}

std::string invalid_rectified(const Calibration& c) {
  if (!c.left.distortion.is_identity()) return "already_rectified: the left camera has distortion";
  if (c.kind != SensorKind::kStereo) return {};
  if (!c.right.distortion.is_identity()) return "already_rectified: the right camera has distortion";
  const PinholeCamera& l = c.left.pinhole;
  const PinholeCamera& r = c.right.pinhole;
  constexpr double kSame = 1e-6;  // [px]
  if (std::abs(l.fx - r.fx) > kSame || std::abs(l.fy - r.fy) > kSame || std::abs(l.cx - r.cx) > kSame ||
      std::abs(l.cy - r.cy) > kSame || l.width != r.width || l.height != r.height) {
    return "already_rectified: the cameras' intrinsics differ";
  }
  const Vector3& t = c.T_right_left.translation();
  if (c.T_right_left.so3().log().norm() > 1e-9 || t.tail<2>().norm() > 1e-9 || t.x() >= 0) {
    return "already_rectified: T_right_left must be a pure shift along -x";
  }
  return {};
}

}  // namespace

std::string Calibration::invalid_reason() const {
  if (const auto reason = left.invalid_reason(); !reason.empty()) return "left camera: " + reason;
  if (kind == SensorKind::kStereo) {
    if (auto reason = invalid_stereo(*this); !reason.empty()) return reason;
  }
  if (already_rectified) {
    if (auto reason = invalid_rectified(*this); !reason.empty()) return reason;
  }
  if (!(fps >= 0) || !std::isfinite(fps)) return "fps must not be negative, is " + std::to_string(fps);
  if (readout) {
    if (auto reason = invalid_readout(*readout, fps); !reason.empty()) return reason;
  }
  if (kind != SensorKind::kMono) {
    if (!(depth_unit > 0)) return "depth_unit must be positive, is " + std::to_string(depth_unit);
    // At 0, pixels without a reading would be readings.
    if (!(depth_min > 0 && depth_max > depth_min)) return "depth_min, depth_max must satisfy 0 < min < max";
  }
  if (kind == SensorKind::kRgbd) {
    if (!(virtual_baseline > 0))
      return "virtual_baseline must be positive, is " + std::to_string(virtual_baseline);
    if (depth_apart) return invalid_depth_camera(depth_camera);
  }
  return {};
}

}  // namespace twofold
