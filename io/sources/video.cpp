#include "io/sources/video.hpp"

#include <cmath>
#include <opencv2/imgproc.hpp>

#include <fmt/format.h>

#include "io/files/calibration_file.hpp"
#include "io/files/io_error.hpp"
#include "io/sources/recording.hpp"

namespace twofold {
namespace {

/// A rolling shutter reads the sensor's rows: they stay as they are, however the video is to be shown.
void open_video(const std::filesystem::path& file, cv::VideoCapture& capture) {
  if (!capture.open(file.string(), cv::CAP_FFMPEG)) throw IoError(file, "is not a video that can be decoded");
  capture.set(cv::CAP_PROP_ORIENTATION_AUTO, 0);
}

}  // namespace

cv::Mat VideoColours::image(std::int64_t index) {
  if (index < 0) return {};
  if (!capture_.isOpened() || index + 1 < next_) {
    open_video(file_, capture_);
    next_ = 0;
  }
  for (; next_ <= index; ++next_) {
    if (!capture_.grab()) throw IoError(file_, fmt::format("frame {} cannot be decoded again", next_));
  }
  cv::Mat image;
  if (!capture_.retrieve(image) || image.empty())
    throw IoError(file_, fmt::format("frame {} cannot be decoded again", index));
  return image.type() == CV_8UC3 ? image : cv::Mat();
}

VideoSource::VideoSource(const std::filesystem::path& file,
                         const std::optional<std::filesystem::path>& calibration,
                         SourceParameters& parameters)
    : file_(file), colours_(file) {
  take_layout(parameters);
  const auto fps = parameters.take_number("fps");
  if (fps && !(*fps > 0)) throw IoError(parameters.subject(), fmt::format("fps={} must be positive", *fps));
  open_video(file, capture_);
  const SensorKind kind = side_by_side_ ? SensorKind::kStereo : SensorKind::kMono;
  Calibration base;
  if (calibration) base = read_calibration(*calibration);
  Calibration used = with_parameters(base, calibration.has_value(), kind, parameters);
  const std::filesystem::path calibration_file = calibration.value_or(parameters.subject());

  const int width = static_cast<int>(capture_.get(cv::CAP_PROP_FRAME_WIDTH)) / (side_by_side_ ? 2 : 1);
  const int height = static_cast<int>(capture_.get(cv::CAP_PROP_FRAME_HEIGHT));
  announced_ = capture_.get(cv::CAP_PROP_FRAME_COUNT);
  at_fixed_rate_ = fps.has_value();
  fps_ = fps.value_or(capture_.get(cv::CAP_PROP_FPS));
  if (!(fps_ > 0) || !std::isfinite(fps_)) fps_ = used.fps;
  if (!(fps_ > 0) || !std::isfinite(fps_)) throw IoError(file, "has no frame rate: give the parameter fps");
  set_missing_size(calibration_file, width, height, &used);
  expect_valid(calibration_file, used);
  if (used.left.pinhole.width != width || used.left.pinhole.height != height) {
    throw IoError(file, fmt::format("the images are {}x{}, the calibration is for {}x{}", width, height,
                                    used.left.pinhole.width, used.left.pinhole.height));
  }
  try {
    rectifier_.emplace(used);
  } catch (const std::runtime_error& e) {
    throw IoError(calibration_file, e.what());
  }
  rig_ = rectifier_->rig();
  R_rectified_raw_ = rectifier_->R_rectified_left();
}

void VideoSource::take_layout(SourceParameters& parameters) {
  const auto layout = parameters.take_text("layout");
  if (layout && *layout != "mono" && *layout != "side-by-side") {
    throw IoError(parameters.subject(), fmt::format("layout='{}' is neither mono nor side-by-side", *layout));
  }
  side_by_side_ = layout && *layout == "side-by-side";
}

bool VideoSource::decode(Frame* raw) {
  cv::Mat image;
  if (!capture_.read(image) || image.empty()) return false;
  if (image.channels() == 3) cv::cvtColor(image, image, cv::COLOR_BGR2GRAY);
  if (image.type() != CV_8UC1)
    throw IoError(file_, fmt::format("frame {} is neither grey nor colour", index_));
  const int half = image.cols / 2;
  // Clones: the halves become images of their own, and the decoder's buffer is reused for the next frame.
  raw->left = side_by_side_ ? image.colRange(0, half).clone() : image.clone();
  if (rig_.kind == SensorKind::kStereo) raw->right = image.colRange(half, 2 * half).clone();
  return true;
}

/// Of the frame that was decoded last, since the first one.
std::int64_t VideoSource::time_stamp() {
  if (at_fixed_rate_) return std::llround(static_cast<double>(index_) / fps_ * 1e9);
  const std::int64_t t_ns = std::llround(1e6 * capture_.get(cv::CAP_PROP_POS_MSEC));
  if (index_ == 0) first_t_ns_ = t_ns;
  const std::int64_t since_first = t_ns - first_t_ns_;
  if (index_ == 0 || since_first > last_t_ns_) return since_first;
  ++without_time_;
  return last_t_ns_ + std::llround(1e9 / fps_);
}

bool VideoSource::read(Frame& frame) {
  Frame raw;
  raw.index = index_;
  if (!decode(&raw)) {
    if (index_ == 0) throw IoError(file_, "holds no frame that can be decoded");
    at_end_ = true;
    return false;
  }
  raw.t_ns = last_t_ns_ = time_stamp();
  if (const auto reason = rectifier_->mismatch_reason(raw); !reason.empty()) throw IoError(file_, reason);
  ++index_;
  frame = Frame();  // its old images may still be held elsewhere: never write into them
  rectifier_->rectify(raw, frame);
  return true;
}

cv::Mat VideoSource::colour_image(std::int64_t index) const {
  cv::Mat image;
  {
    const std::scoped_lock lock(colours_mutex_);
    image = colours_.image(index);
  }
  if (image.empty()) return image;
  return rectifier_->rectified_left(side_by_side_ ? image.colRange(0, image.cols / 2).clone() : image);
}

SourceReport VideoSource::report() const {
  SourceReport report;
  if (const std::string black = rectifier_->black_note(); !black.empty())
    report.notes.push_back(file_.string() + ": " + black);
  if (without_time_ > 0) {
    report.summary.push_back(fmt::format(
        "{}: {} frames have no time of their own, or one that is not after the frame before: each was taken "
        "to be 1/{:g} s after that (the parameter fps gives all frames the same rate)",
        file_.string(), without_time_, fps_));
  }
  // Containers that have no count take length times rate: a frame or two, or one in a hundred, say nothing.
  constexpr double kTold = 0.98, kSlack = 2;
  if (at_end_ && static_cast<double>(index_) < kTold * announced_ - kSlack) {
    report.faults.push_back(
        fmt::format("{}: {} frames could be decoded of {:.0f} that are announced: it is cut short or damaged",
                    file_.string(), index_, announced_));
  }
  return report;
}

}  // namespace twofold
