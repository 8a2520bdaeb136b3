#include "surface/stereo_depth.hpp"

#include <algorithm>
#include <cmath>
#include <opencv2/calib3d.hpp>

namespace twofold {
namespace {

constexpr int kBlock = 5;           // edge of the matched windows [px]
constexpr int kUnits = 16;          // of a disparity in OpenCV's images
constexpr int kLeastDisparity = 2;  // farther is noise [px]

}  // namespace

cv::Mat stereo_depth(const Rig& rig, const cv::Mat& left, const cv::Mat& right, double nearest) {
  const double most = std::min(rig.disparity_from_depth(nearest), 0.4 * rig.camera.width);
  const int range = std::max(16, (static_cast<int>(std::ceil(most)) + 15) / 16 * 16);
  const auto matcher = cv::StereoSGBM::create(0, range, kBlock, 8 * kBlock * kBlock, 32 * kBlock * kBlock, 1,
                                              31, 10, 100, 2, cv::StereoSGBM::MODE_SGBM_3WAY);
  cv::Mat disparity;
  matcher->compute(left, right, disparity);
  cv::Mat depth = cv::Mat::zeros(left.size(), CV_16UC1);
  const double far = 65535 * rig.depth_unit;
  for (int y = 0; y < depth.rows; ++y) {
    const auto* d = disparity.ptr<std::int16_t>(y);
    auto* z = depth.ptr<std::uint16_t>(y);
    for (int x = 0; x < depth.cols; ++x) {
      if (d[x] < kLeastDisparity * kUnits) continue;
      const double metres = rig.depth_from_disparity(static_cast<double>(d[x]) / kUnits);
      if (metres < far) z[x] = static_cast<std::uint16_t>(std::lround(metres / rig.depth_unit));
    }
  }
  return depth;
}

}  // namespace twofold
