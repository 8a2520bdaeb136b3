#include "io/sources/left_camera_source.hpp"

namespace twofold {

LeftCameraSource::LeftCameraSource(std::unique_ptr<FrameSource> source) : source_(std::move(source)) {
  rig_ = source_->rig();
  R_rectified_raw_ = source_->R_rectified_raw();
  rig_.kind = SensorKind::kMono;
  rig_.baseline = 0;
  ground_truth_ = source_->ground_truth();
}

bool LeftCameraSource::read(Frame& frame) {
  if (!next_or_throw(*source_, frame)) return false;
  frame.right = cv::Mat();
  frame.depth = cv::Mat();
  return true;
}

}  // namespace twofold
