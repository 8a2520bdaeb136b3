#pragma once

#include <span>
#include <string>
#include <tl/expected.hpp>

#include "camera/distortion.hpp"

namespace twofold {

/// The lens of OpenCV's vector of 4, 5, 8, 12 or 14 coefficients, which is ROS', too:
/// k1 k2 p1 p2 [k3 [k4 k5 k6 [s1 s2 s3 s4 [tau_x tau_y]]]].
///
/// @return kRational where k4, k5 or k6 is not zero, else kRadTan. Or why there is none: another number of
///         coefficients; a thin prism (s) or a tilted sensor (tau) that is not zero
[[nodiscard]] tl::expected<Distortion, std::string> opencv_distortion(std::span<const double> coefficients);

/// The lens of the four coefficients of OpenCV's fisheye module, ROS' and Kalibr's equidistant model: k1 k2
/// k3 k4, with zeros after them where a vector has room for more.
///
/// @return kEquidistant; or why there is none: fewer than four, or others behind them that are not zero
[[nodiscard]] tl::expected<Distortion, std::string> equidistant_distortion(
    std::span<const double> coefficients);

}  // namespace twofold
