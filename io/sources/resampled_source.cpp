#include "io/sources/resampled_source.hpp"

#include <cmath>
#include <opencv2/imgproc.hpp>
#include <utility>

#include <fmt/format.h>

#include "base/check.hpp"
#include "io/files/io_error.hpp"

namespace twofold {
namespace {

constexpr double kMostChange = 4;  // of the images' sides
constexpr int kSmallest = 64;      // [px]

struct Side {
  int size = 0;
  double f = 0, centre = 0;
};

/// Whole pixels; the focal length follows from them. Pixel centres lie at whole numbers.
Side resampled(int size, double f, double centre, double wanted_f) {
  const int target = static_cast<int>(std::lround(size * wanted_f / f));
  const double scale = static_cast<double>(target) / size;
  return {target, f * scale, (centre + 0.5) * scale - 0.5};
}

}  // namespace

ResampledSource::ResampledSource(std::unique_ptr<FrameSource> source, const PinholeCamera& like)
    : source_(std::move(source)) {
  TWOFOLD_CHECK(source_->rig().kind == SensorKind::kMono, "one camera has no second image to keep in step");
  rig_ = source_->rig();
  R_rectified_raw_ = source_->R_rectified_raw();
  ground_truth_ = source_->ground_truth();
  PinholeCamera& camera = rig_.camera;
  for (const auto& [own, wanted] : {std::pair{camera.fx, like.fx}, {camera.fy, like.fy}}) {
    if (wanted > kMostChange * own || own > kMostChange * wanted)
      throw IoError(
          fmt::format("the camera's focal length, {:.1f} px, is more than {} times another one than the "
                      "map's, {:.1f} px",
                      own, kMostChange, wanted));
  }
  const Side x = resampled(camera.width, camera.fx, camera.cx, like.fx);
  const Side y = resampled(camera.height, camera.fy, camera.cy, like.fy);
  if (std::min(x.size, y.size) < kSmallest)
    throw IoError(
        fmt::format("at the map's angular resolution the images have {}x{} pixels: too few", x.size, y.size));
  camera = {x.f, y.f, x.centre, y.centre, x.size, y.size};
}

bool ResampledSource::read(Frame& frame) {
  if (!next_or_throw(*source_, own_)) return false;
  frame.index = own_.index;
  frame.t_ns = own_.t_ns;
  const cv::Size size(rig_.camera.width, rig_.camera.height);
  // Reduced, a pixel is the mean of what it covers.
  const bool smaller = size.area() < own_.left.size().area();
  cv::Mat image;  // others may still hold the last one
  cv::resize(own_.left, image, size, 0, 0, smaller ? cv::INTER_AREA : cv::INTER_CUBIC);
  frame.left = image;
  frame.right = frame.depth = cv::Mat();
  return true;
}

}  // namespace twofold
