#include "io/sources/preloaded_source.hpp"

#include <fmt/format.h>

#include "io/files/io_error.hpp"

namespace twofold {
namespace {

std::size_t bytes_of(const cv::Mat& image) {
  return image.total() * image.elemSize();
}

}  // namespace

PreloadedSource::PreloadedSource(std::unique_ptr<FrameSource> source, std::size_t max_bytes)
    : source_(std::move(source)) {
  rig_ = source_->rig();
  R_rectified_raw_ = source_->R_rectified_raw();
  ground_truth_ = source_->ground_truth();
  Frame frame;
  std::size_t image_bytes = 0;
  while (next_or_throw(*source_, frame)) {
    image_bytes += bytes_of(frame.left) + bytes_of(frame.right) + bytes_of(frame.depth);
    if (image_bytes > max_bytes) {
      throw IoError("preload",
                    fmt::format("the images take more than {} MB: run without --preload", max_bytes >> 20));
    }
    frames_.push_back(frame);
    frame = Frame();
  }
}

bool PreloadedSource::read(Frame& frame) {
  if (next_ == frames_.size()) return false;
  frame = frames_[next_++];
  return true;
}

}  // namespace twofold
