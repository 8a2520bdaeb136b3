#include "camera/rig.hpp"

#include "camera/measurement.hpp"

namespace twofold {

Eigen::Vector3f Rig::information(const StereoPixelF& z, int level) const {
  const double sigma = sigma_px(level);
  const auto pixel = static_cast<float>(1 / (sigma * sigma));
  if (kind == SensorKind::kMono || !has_right(z)) return {pixel, pixel, 0};
  if (kind == SensorKind::kStereo) return {pixel, pixel, pixel};
  const auto depth_sigma = static_cast<float>(noise.depth_sigma_px);
  return {pixel, pixel, 1 / (depth_sigma * depth_sigma)};
}

}  // namespace twofold
