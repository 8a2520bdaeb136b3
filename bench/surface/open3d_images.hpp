#pragma once

#include <open3d/geometry/RGBDImage.h>

#include <cstring>
#include <memory>
#include <opencv2/imgproc.hpp>

#include "camera/rig.hpp"

namespace twofold {

inline open3d::geometry::Image open3d_image(const cv::Mat& pixels) {
  open3d::geometry::Image image;
  image.Prepare(pixels.cols, pixels.rows, pixels.channels(), static_cast<int>(pixels.elemSize1()));
  std::memcpy(image.data_.data(), pixels.data, pixels.total() * pixels.elemSize());
  return image;
}

/// @param depth   CV_16UC1 in units of Rig::depth_unit; beyond Rig::depth_max it is left out
/// @param colour  CV_8UC3: blue, green, red
inline std::shared_ptr<open3d::geometry::RGBDImage> open3d_rgbd(const Rig& rig, const cv::Mat& depth,
                                                                const cv::Mat& colour) {
  cv::Mat rgb;
  cv::cvtColor(colour, rgb, cv::COLOR_BGR2RGB);
  return open3d::geometry::RGBDImage::CreateFromColorAndDepth(open3d_image(rgb), open3d_image(depth),
                                                              1 / rig.depth_unit, rig.depth_max, false);
}

inline open3d::camera::PinholeCameraIntrinsic open3d_camera(const PinholeCamera& c) {
  return {c.width, c.height, c.fx, c.fy, c.cx, c.cy};
}

}  // namespace twofold
