#include "io/sources/frame_source.hpp"

#include <utility>

#include <fmt/format.h>

#include "io/files/io_error.hpp"

namespace twofold {
namespace {

void check_image(const cv::Mat& image, const char* name, int type, const Rig& rig, std::int64_t index) {
  const std::string subject = fmt::format("frame {}", index);
  if (image.type() != type || image.empty()) {
    throw IoError(subject, fmt::format("the {} image is empty or not of the expected type", name));
  }
  if (image.cols != rig.camera.width || image.rows != rig.camera.height) {
    throw IoError(subject, fmt::format("the {} image is {}x{}, the calibration is for {}x{}", name,
                                       image.cols, image.rows, rig.camera.width, rig.camera.height));
  }
}

void check_images(const Frame& frame, const Rig& rig) {
  check_image(frame.left, "left", CV_8UC1, rig, frame.index);
  if (rig.kind == SensorKind::kStereo) check_image(frame.right, "right", CV_8UC1, rig, frame.index);
  if (rig.kind == SensorKind::kRgbd) check_image(frame.depth, "depth", CV_16UC1, rig, frame.index);
}

}  // namespace

FrameStatus FrameSource::next(Frame& frame) {
  if (peeked_) {
    frame = *std::exchange(peeked_, std::nullopt);
    return FrameStatus::kFrame;
  }
  if (status_ != FrameStatus::kFrame) return status_;
  try {
    if (!read(frame)) return status_ = FrameStatus::kEnd;
    check_images(frame, rig_);
    if (any_ && frame.t_ns <= last_t_ns_) {
      throw IoError(
          fmt::format("frame {}", frame.index),
          fmt::format("time stamp {} ns is not after the one before it, {} ns", frame.t_ns, last_t_ns_));
    }
    any_ = true;
    last_t_ns_ = frame.t_ns;
  } catch (const std::exception& e) {
    error_ = e.what();
    status_ = FrameStatus::kError;
  }
  return status_;
}

const Frame* FrameSource::peek() {
  if (peeked_) return &*peeked_;
  Frame frame;
  if (!next_or_throw(*this, frame)) return nullptr;
  return &peeked_.emplace(std::move(frame));
}

bool next_or_throw(FrameSource& source, Frame& frame) {
  switch (source.next(frame)) {
    case FrameStatus::kFrame:
      return true;
    case FrameStatus::kEnd:
      return false;
    case FrameStatus::kError:
      break;
  }
  throw IoError(source.error());
}

}  // namespace twofold
