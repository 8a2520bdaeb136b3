#include "camera/camera_model.hpp"

#include <algorithm>
#include <cmath>

namespace twofold {
namespace {

constexpr int kLargestSide =
    16384;  // maps for two such images take four gigabytes: a file's mistake costs more

/// Focal lengths of millimetres, normalised ones, and slips of a digit.
std::string strange_focal_length(const PinholeCamera& p) {
  constexpr double kShortest = 0.05;  // of the width: a fisheye that sees all around has three times as much
  constexpr double kMostApart = 3;    // fields of half the rows have 2
  const std::string both = std::to_string(p.fx) + ", " + std::to_string(p.fy);
  if (p.fx < kShortest * p.width)
    return "fx, fy are focal lengths in pixels, of an image " + std::to_string(p.width) + " wide; they are " +
           both;
  if (p.fx > kMostApart * p.fy || p.fy > kMostApart * p.fx)
    return "fx, fy must be nearly the same, are " + both;
  return {};
}

/// Whether a circle around the principal point can be seen: so much of the largest that fits into the image.
bool sees_its_middle(const CameraModel& camera, double share) {
  const PinholeCamera& p = camera.pinhole;
  const double radius = share * std::min({p.cx, p.cy, p.width - 1 - p.cx, p.height - 1 - p.cy});
  if (radius <= 0) return true;
  const Vector2 centre(p.cx, p.cy);
  const Vector2 right(radius, 0), down(0, radius);
  const auto sees = [&](const Vector2& offset) { return camera.unproject(centre + offset).has_value(); };
  return sees(right) && sees(-right) && sees(down) && sees(-down);
}

}  // namespace

std::string CameraModel::invalid_reason() const {
  const auto positive = [](double x) { return std::isfinite(x) && x > 0; };
  if (!positive(pinhole.fx)) return "fx must be positive, is " + std::to_string(pinhole.fx);
  if (!positive(pinhole.fy)) return "fy must be positive, is " + std::to_string(pinhole.fy);
  if (!std::isfinite(pinhole.cx) || !std::isfinite(pinhole.cy)) return "cx, cy must be finite";
  if (pinhole.width <= 0 || pinhole.height <= 0) {
    return "image size must be positive, is " + std::to_string(pinhole.width) + " x " +
           std::to_string(pinhole.height);
  }
  if (pinhole.width > kLargestSide || pinhole.height > kLargestSide) {
    return "image size must be within " + std::to_string(kLargestSide) + " a side, is " +
           std::to_string(pinhole.width) + " x " + std::to_string(pinhole.height);
  }
  if (auto reason = strange_focal_length(pinhole); !reason.empty()) return reason;
  // Outside of a part that was cut out of a larger image, but not far from it.
  const auto near = [](double c, int size) { return c >= -size && c <= 2.0 * size; };
  if (!near(pinhole.cx, pinhole.width) || !near(pinhole.cy, pinhole.height)) {
    return "cx, cy must be in or near the image [px], are " + std::to_string(pinhole.cx) + ", " +
           std::to_string(pinhole.cy);
  }
  if (auto reason = distortion.invalid_reason(); !reason.empty()) return reason;
  // A strong lens' polynomial of three terms may well fold over near the rim.
  const bool rational = distortion.model == DistortionModel::kRational;
  const bool radtan = distortion.model == DistortionModel::kRadTan;
  if ((rational || radtan) && !sees_its_middle(*this, rational ? 1 : 0.4)) {
    return std::string("the lens folds the middle of the image over: are its coefficients k1 k2 p1 p2") +
           (rational ? " k3 k4 k5 k6" : "") + ", in this order and with all their digits?";
  }
  return {};
}

Vector2 CameraModel::project(const Vector3& x_c, Matrix23* J) const {
  const double inv_z = 1 / x_c.z();
  const Vector2 xy = x_c.head<2>() * inv_z;
  Eigen::Matrix2d J_distort;
  const Vector2 xy_d = distortion.distort(xy, J ? &J_distort : nullptr);
  if (J) {
    Matrix23 J_xy;  // B.2
    J_xy << inv_z, 0, -xy.x() * inv_z, 0, inv_z, -xy.y() * inv_z;
    *J = Vector2(pinhole.fx, pinhole.fy).asDiagonal() * J_distort * J_xy;
  }
  return {pinhole.fx * xy_d.x() + pinhole.cx, pinhole.fy * xy_d.y() + pinhole.cy};
}

std::optional<Vector3> CameraModel::unproject(const Vector2& uv) const {
  const auto xy = distortion.undistort(pinhole.unproject(uv).head<2>());
  if (!xy) return std::nullopt;
  return Vector3(xy->x(), xy->y(), 1.0);
}

}  // namespace twofold
