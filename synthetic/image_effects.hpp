#pragma once

#include <cstdint>
#include <opencv2/core/mat.hpp>

#include "camera/rig.hpp"

namespace twofold::synthetic {

/// Which random numbers an image gets: they are a function of this and the pixel alone.
struct NoiseKey {
  std::uint64_t seed = 0;
  std::uint64_t stream = 0;  ///< differs for each image of a run
};

/// Eight-bit image of a sensor: gain * intensity plus Gaussian noise of `sigma` grey levels, rounded,
/// clipped. intensity: CV_32FC1.
[[nodiscard]] cv::Mat expose(const cv::Mat& intensity, double gain, double sigma, const NoiseKey& key);

/// Depth image (CV_16UC1, units of rig.depth_unit) of a structured-light camera from CV_32FC1 inverse depth.
///
/// Noise grows with the square of the depth, sigma = 1.425 mm/m^2 z^2 times noise_scale  (Khoshelham and Oude
/// Elberink, Sensors 2012). No reading (0) out of the rig's range, next to a jump in depth, on surfaces
/// steeper than 75 degrees, and at a few random spots.
[[nodiscard]] cv::Mat sense_depth(const cv::Mat& inverse_depth, const Rig& rig, double noise_scale,
                                  const NoiseKey& key);

}  // namespace twofold::synthetic
