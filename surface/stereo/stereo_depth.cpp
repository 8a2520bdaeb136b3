#include "surface/stereo/stereo_depth.hpp"

#include <algorithm>
#include <cmath>
#include <opencv2/calib3d.hpp>
#include <opencv2/imgproc.hpp>

#include "surface/stereo/disparity_refinement.hpp"

namespace twofold {
namespace {

constexpr int kUnits = 16;          // of a disparity in OpenCV's images
constexpr int kLeastDisparity = 2;  // farther is noise [px]
constexpr double kMostSigma = 0.2;  // of a disparity that is kept [px]
constexpr int kRim = 2;             // matching widens near things by about so much [px]
constexpr float kJump = 1.5f;       // of disparity, at a rim [px]

/// Semi-global matching to about a pixel. The images are made wider on the left, where the library would
/// leave out as many columns as disparities it tries.
cv::Mat match(const cv::Mat& left, const cv::Mat& right, int range) {
  constexpr int kBlock = 3;  // edge of the matched windows [px]: as small as noise allows, for the rims' sake
  constexpr int kSmall = 24,
                kLarge = 96;  // costs of a step of disparity by one, and by more, for each pixel of a block
  constexpr double kSmoothing = 0.8;  // against noise [px]
  const auto matcher =
      cv::StereoSGBM::create(0, range, kBlock, kSmall * kBlock * kBlock, kLarge * kBlock * kBlock, 1, 31, 10,
                             100, 2, cv::StereoSGBM::MODE_SGBM_3WAY);
  const auto prepared = [&](const cv::Mat& image) {
    cv::Mat smooth, wide;
    cv::GaussianBlur(image, smooth, {5, 5}, kSmoothing);
    cv::copyMakeBorder(smooth, wide, 0, 0, range, 0, cv::BORDER_REPLICATE);
    return wide;
  };
  cv::Mat wide, disparity;
  matcher->compute(prepared(left), prepared(right), wide);
  wide.colRange(range, wide.cols).convertTo(disparity, CV_32F, 1.0 / kUnits);
  disparity.setTo(0, disparity < kLeastDisparity);
  return disparity;
}

/// Takes away what lies beside something farther.
void erode_rims(cv::Mat& disparity) {
  cv::Mat farthest = disparity.clone();
  farthest.setTo(1e6, disparity <= 0);
  cv::erode(farthest, farthest, cv::Mat::ones(2 * kRim + 1, 2 * kRim + 1, CV_8U));
  disparity.setTo(0, disparity - farthest > kJump);
}

}  // namespace

cv::Mat stereo_depth(const Rig& rig, const cv::Mat& left, const cv::Mat& right, double nearest) {
  const double most = std::min(rig.disparity_from_depth(nearest), 0.4 * rig.camera.width);
  const int range = std::max(16, (static_cast<int>(std::ceil(most)) + 15) / 16 * 16);
  cv::Mat disparity = refine_disparity(left, right, match(left, right, range), kMostSigma);
  erode_rims(disparity);
  cv::Mat depth = cv::Mat::zeros(left.size(), CV_16UC1);
  const double far = 65535 * rig.depth_unit;
  for (int y = 0; y < depth.rows; ++y) {
    const auto* d = disparity.ptr<float>(y);
    auto* z = depth.ptr<std::uint16_t>(y);
    for (int x = 0; x < depth.cols; ++x) {
      if (d[x] < kLeastDisparity) continue;
      const double metres = rig.depth_from_disparity(d[x]);
      if (metres < far) z[x] = static_cast<std::uint16_t>(std::lround(metres / rig.depth_unit));
    }
  }
  return depth;
}

}  // namespace twofold
