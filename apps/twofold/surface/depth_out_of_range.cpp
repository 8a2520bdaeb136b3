#include "apps/twofold/surface/depth_out_of_range.hpp"

#include <algorithm>
#include <opencv2/core.hpp>

#include <fmt/format.h>

namespace twofold {

void DepthOutOfRange::look_at(const Rig& rig, const cv::Mat& depth) {
  const double unit = depth.type() == CV_16UC1 ? rig.depth_unit : 1;
  double low = 0, high = 0;
  cv::minMaxLoc(depth, &low, &high, nullptr, nullptr, depth > 0);
  low *= unit;
  high *= unit;
  if (high <= 0 || (low <= rig.depth_max && high >= rig.depth_min)) return;
  nearest_ = farthest_ > 0 ? std::min(nearest_, low) : low;
  farthest_ = std::max(farthest_, high);
}

std::string DepthOutOfRange::text(const Rig& rig) const {
  std::string all =
      fmt::format("depth images without any reading from {:g} to {:g} m", rig.depth_min, rig.depth_max);
  if (farthest_ > 0) {
    all += fmt::format("; theirs are from {:.4g} to {:.4g} m", nearest_, farthest_);
    if (rig.kind == SensorKind::kRgbd)
      all += fmt::format(", by a unit of {:g} m (depth: unit)", rig.depth_unit);
  }
  return all;
}

}  // namespace twofold
