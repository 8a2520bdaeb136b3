#include "surface/depth_view.hpp"

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>

#include <fmt/format.h>

#include "geometry/check.hpp"

namespace twofold {
namespace {

constexpr float kJumpRatio = 0.05f;  // of the depth, across two pixels; a slope of 75 degrees stays below it
constexpr float kNone = 1e9f;

/// [m]; kNone where there is no reading.
cv::Mat readings(const Rig& rig, const cv::Mat& depth) {
  cv::Mat metres;
  if (depth.type() == CV_16UC1) {
    depth.convertTo(metres, CV_32F, rig.depth_unit);
  } else {
    metres = depth.clone();
  }
  const auto low = static_cast<float>(rig.depth_min);
  const auto high = static_cast<float>(rig.depth_max);
  for (int y = 0; y < metres.rows; ++y) {
    auto* row = metres.ptr<float>(y);
    // NaN keeps no comparison.
    for (int x = 0; x < metres.cols; ++x) row[x] = row[x] >= low && row[x] <= high ? row[x] : kNone;
  }
  return metres;
}

/// Inverse depth of a plane is linear in the image: w = n . (x, y, 1) on rays (x, y, 1), where n is the
/// plane's normal over its distance. So the cosine is w over the lengths of n and of the ray. The slope is
/// taken across seven pixels of a smoothed image, because that of two neighbours is mostly noise.
cv::Mat facing_of(const PinholeCamera& camera, const cv::Mat& depth) {
  constexpr int kHalf = 2;
  cv::Mat inverse(depth.size(), CV_32FC1), count(depth.size(), CV_32FC1);
  for (int y = 0; y < depth.rows; ++y) {
    const auto* z = depth.ptr<float>(y);
    auto* w = inverse.ptr<float>(y);
    auto* n = count.ptr<float>(y);
    for (int x = 0; x < depth.cols; ++x) {
      n[x] = z[x] > 0 ? 1.0f : 0.0f;
      w[x] = n[x] / std::max(z[x], 1e-3f);
    }
  }
  cv::blur(inverse, inverse, {5, 5});
  cv::blur(count, count, {5, 5});
  for (int y = 0; y < depth.rows; ++y) {
    auto* w = inverse.ptr<float>(y);
    const auto* n = count.ptr<float>(y);
    for (int x = 0; x < depth.cols; ++x) w[x] /= std::max(n[x], 0.02f);
  }
  cv::Mat facing(depth.size(), CV_32FC1, cv::Scalar(1));
  const auto fx = static_cast<float>(camera.fx), fy = static_cast<float>(camera.fy);
  const auto cx = static_cast<float>(camera.cx), cy = static_cast<float>(camera.cy);
  for (int y = kHalf; y < depth.rows - kHalf; ++y) {
    const auto* w = inverse.ptr<float>(y);
    const auto* above = inverse.ptr<float>(y - kHalf);
    const auto* below = inverse.ptr<float>(y + kHalf);
    auto* f = facing.ptr<float>(y);
    const float ry = (static_cast<float>(y) - cy) / fy;
    for (int x = kHalf; x < depth.cols - kHalf; ++x) {
      const float rx = (static_cast<float>(x) - cx) / fx;
      const float nx = fx * (w[x + kHalf] - w[x - kHalf]) / (2 * kHalf);
      const float ny = fy * (below[x] - above[x]) / (2 * kHalf);
      const float nz = w[x] - nx * rx - ny * ry;
      const float lengths = (nx * nx + ny * ny + nz * nz) * (rx * rx + ry * ry + 1);
      f[x] = std::max(0.1f, std::min(1.0f, w[x] / std::sqrt(std::max(lengths, 1e-12f))));
    }
  }
  return facing;
}

}  // namespace

std::string depth_defect(const Rig& rig, const cv::Mat& depth, const cv::Mat& colour) {
  if (depth.empty()) return "there is no depth image";
  if (depth.type() != CV_16UC1 && depth.type() != CV_32FC1)
    return fmt::format("a depth image has one channel of 16 bits or floats, this one has {} of {} bits",
                       depth.channels(), 8 * depth.elemSize1());
  const auto is_of_rig = [&](const cv::Mat& image) {
    return image.cols == rig.camera.width && image.rows == rig.camera.height;
  };
  if (!is_of_rig(depth))
    return fmt::format("the depth image is {}x{}, the camera {}x{}", depth.cols, depth.rows, rig.camera.width,
                       rig.camera.height);
  if (colour.empty()) return {};
  if (colour.type() != CV_8UC3 && colour.type() != CV_8UC1)
    return "a colour image has three channels of 8 bits, or one";
  if (!is_of_rig(colour))
    return fmt::format("the colour image is {}x{}, the camera {}x{}", colour.cols, colour.rows,
                       rig.camera.width, rig.camera.height);
  return {};
}

DepthView make_depth_view(const Rig& rig, const cv::Mat& depth, const cv::Mat& colour) {
  TWOFOLD_CHECK(depth_defect(rig, depth, colour).empty(), "the depth image fits the rig");
  DepthView view;
  view.camera = rig.camera;
  view.colour = colour;
  view.depth = readings(rig, depth);
  cv::Mat farthest, holes_are_near = view.depth.clone();
  for (int y = 0; y < depth.rows; ++y) {
    auto* row = holes_are_near.ptr<float>(y);
    for (int x = 0; x < depth.cols; ++x) row[x] = row[x] < kNone ? row[x] : 0;
  }
  cv::Mat lowest;
  cv::erode(view.depth, lowest, {});
  cv::dilate(holes_are_near, farthest, {});
  cv::erode(holes_are_near, view.nearest, {});
  for (int y = 0; y < depth.rows; ++y) {
    auto* row = view.depth.ptr<float>(y);
    const auto* low = lowest.ptr<float>(y);
    const auto* high = farthest.ptr<float>(y);
    for (int x = 0; x < depth.cols; ++x)
      row[x] = row[x] < kNone && high[x] - low[x] <= kJumpRatio * low[x] ? row[x] : 0;
  }
  view.facing = facing_of(rig.camera, view.depth);
  return view;
}

double share_of_readings(const DepthView& view) {
  return static_cast<double>(cv::countNonZero(view.depth)) / static_cast<double>(view.depth.total());
}

}  // namespace twofold
