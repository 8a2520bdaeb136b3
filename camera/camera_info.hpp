#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <tl/expected.hpp>
#include <vector>

#include "camera/camera_model.hpp"
#include "geometry/se3.hpp"

namespace twofold {

/// sensor_msgs/CameraInfo: raw pixel = K distort(ray, D); rectified pixel = P [R ray; 1].
struct CameraInfoMessage {
  std::uint32_t width = 0, height = 0;
  std::string distortion_model;
  std::vector<double> D;
  std::array<double, 9> K{}, R{};  ///< row by row
  std::array<double, 12> P{};
};

/// The camera of raw images: K and D. Zeros at the end of D may be left out, and zeros alone are no
/// distortion, but of a fisheye, whose image is none of a pinhole even so.
///
/// @return  or why there is none: a distortion that is not known, or has more coefficients than are supported
[[nodiscard]] tl::expected<CameraModel, std::string> raw_camera(const CameraInfoMessage& info);

/// K without the lens, and P: the cameras of raw and of rectified images.
[[nodiscard]] PinholeCamera raw_pinhole(const CameraInfoMessage& info);
[[nodiscard]] PinholeCamera rectified_pinhole(const CameraInfoMessage& info);

/// From the raw camera to the rectified one; or why R is no rotation.
[[nodiscard]] tl::expected<SO3, std::string> rectifying_rotation(const CameraInfoMessage& info);

/// t of a pair's rectified cameras, p_right = p_left + t [m], by their P; neither need be where these have
/// the origin.
///
/// @return  or why there is none: focal lengths that differ, no baseline
[[nodiscard]] tl::expected<Vector3, std::string> rectified_translation(const CameraInfoMessage& left,
                                                                       const CameraInfoMessage& right);

}  // namespace twofold
