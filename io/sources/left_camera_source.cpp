#include "io/sources/left_camera_source.hpp"

#include "io/files/io_error.hpp"

namespace twofold {

LeftCameraSource::LeftCameraSource(std::unique_ptr<FrameSource> source) : source_(std::move(source)) {
  rig_ = source_->rig();
  rig_.kind = SensorKind::kMono;
  rig_.baseline = 0;
  ground_truth_ = source_->ground_truth();
}

bool LeftCameraSource::read(Frame& frame) {
  const FrameStatus status = source_->next(frame);
  if (status == FrameStatus::kError) throw IoError(source_->error());
  frame.right = cv::Mat();
  frame.depth = cv::Mat();
  return status == FrameStatus::kFrame;
}

}  // namespace twofold
