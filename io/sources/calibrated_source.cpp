#include "io/sources/calibrated_source.hpp"

#include "io/files/io_error.hpp"

namespace twofold {

CalibratedSource::CalibratedSource(std::unique_ptr<FrameSource> source, const Calibration& calibration)
    : source_(std::move(source)), rectifier_(calibration) {
  rig_ = rectifier_.rig();
  R_rectified_raw_ = rectifier_.R_rectified_left() * source_->R_rectified_raw();
  ground_truth_ = source_->ground_truth();
}

cv::Mat CalibratedSource::colour_image(std::int64_t index) const {
  const cv::Mat raw = source_->colour_image(index);
  return raw.empty() ? raw : rectifier_.rectified_left(raw);
}

bool CalibratedSource::read(Frame& frame) {
  Frame raw;
  const FrameStatus status = source_->next(raw);
  if (status == FrameStatus::kError) throw IoError(source_->error());
  if (status == FrameStatus::kEnd) return false;
  frame = Frame();  // its old images may still be held elsewhere: never write into them
  rectifier_.rectify(raw, frame);
  return true;
}

}  // namespace twofold
