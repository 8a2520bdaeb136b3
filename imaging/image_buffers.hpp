#pragma once

#include "camera/rig.hpp"
#include "imaging/image_pyramid.hpp"

namespace twofold {

/// Makes room for the images of one frame of this rig, all black: filling it later allocates nothing.
inline void allocate_images(const Rig& rig, FrameImages& images) {
  const cv::Mat black(rig.camera.height, rig.camera.width, CV_8UC1, cv::Scalar(0));
  images.left.build(black);
  if (rig.kind == SensorKind::kStereo) images.right.build(black);
  if (rig.kind == SensorKind::kRgbd) images.depth = cv::Mat(black.rows, black.cols, CV_16UC1, cv::Scalar(0));
}

}  // namespace twofold
