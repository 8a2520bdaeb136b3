#include "io/sources/v4l2_source.hpp"

#include <fmt/format.h>

#include "io/files/calibration_file.hpp"
#include "io/files/io_error.hpp"
#include "io/sources/recording.hpp"

namespace twofold {

V4l2Source::V4l2Source(const SourceSpec& spec, const SourceOptions& options, std::unique_ptr<V4l2Calls> calls)
    : V4l2Source(SourceParameters(spec.text, spec.parameters, options.suppose_camera), spec, options,
                 std::move(calls)) {}

V4l2Source::V4l2Source(SourceParameters parameters, const SourceSpec& spec, const SourceOptions& options,
                       std::unique_ptr<V4l2Calls> calls)
    : calls_(calls ? std::move(calls) : std::make_unique<SystemV4l2Calls>()),
      device_(spec.argument),
      frames_(*calls_, take_v4l2_options(spec.argument, parameters)),
      stop_(options.stop ? options.stop : &never_) {
  rig_.kind = frames_.kind();
  rig_.camera.width = frames_.width();
  rig_.camera.height = frames_.height();
  if (!options.raw) set_up_calibration(parameters, options);
  parameters.expect_all_taken();
}

void V4l2Source::set_up_calibration(SourceParameters& parameters, const SourceOptions& options) {
  Calibration base;
  if (options.calibration) base = read_calibration(*options.calibration);
  Calibration used = with_parameters(base, options.calibration.has_value(), frames_.kind(), parameters);
  const std::filesystem::path file = options.calibration.value_or(parameters.subject());
  set_missing_size(file, frames_.width(), frames_.height(), &used);
  expect_valid(file, used);
  const PinholeCamera& camera = used.left.pinhole;
  if (camera.width != frames_.width() || camera.height != frames_.height()) {
    throw IoError(device_, fmt::format("the images are {}x{}, the calibration is for {}x{}", frames_.width(),
                                       frames_.height(), camera.width, camera.height));
  }
  try {
    rectifier_.emplace(used);
  } catch (const std::runtime_error& e) {
    throw IoError(file, e.what());
  }
  rig_ = rectifier_->rig();
  R_rectified_raw_ = rectifier_->R_rectified_left();
}

SourceReport V4l2Source::report() const {
  SourceReport report = frames_.report();
  if (!rectifier_) return report;
  if (const std::string black = rectifier_->black_note(); !black.empty())
    report.notes.push_back(device_ + ": " + black);
  return report;
}

namespace {

/// The image, or a copy if it lies in the driver's memory, which goes back with the next call: such a Mat has
/// no memory of its own.
cv::Mat keep(const cv::Mat& image) {
  return image.u == nullptr ? image.clone() : image;
}

}  // namespace

bool V4l2Source::read(Frame& frame) {
  Frame raw;
  if (frames_.next(*stop_, &raw) == V4l2Frames::Status::kStopped) return false;
  frame = Frame();  // its old images may still be held elsewhere: never write into them
  if (rectifier_ && !rectifier_->passes_through()) {
    if (const auto reason = rectifier_->mismatch_reason(raw); !reason.empty()) throw IoError(device_, reason);
    rectifier_->rectify(raw, frame);
    return true;
  }
  frame.index = raw.index;
  frame.t_ns = raw.t_ns;
  frame.left = keep(raw.left);
  frame.right = keep(raw.right);
  frame.depth = keep(raw.depth);
  return true;
}

}  // namespace twofold
