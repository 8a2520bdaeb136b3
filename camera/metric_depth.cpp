#include "camera/metric_depth.hpp"

#include <cmath>
#include <cstdint>

namespace twofold {

cv::Mat in_depth_units(const cv::Mat& metres, double unit) {
  cv::Mat units(metres.size(), CV_16UC1);
  for (int y = 0; y < metres.rows; ++y) {
    const float* from = metres.ptr<float>(y);
    auto* to = units.ptr<std::uint16_t>(y);
    for (int x = 0; x < metres.cols; ++x) {
      const double value = std::round(from[x] / unit);
      to[x] = value > 0 && value < 65536 ? static_cast<std::uint16_t>(value) : 0;  // NaN compares false
    }
  }
  return units;
}

}  // namespace twofold
