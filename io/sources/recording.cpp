#include "io/sources/recording.hpp"

#include <algorithm>
#include <optional>
#include <span>
#include <string_view>

#include <fmt/format.h>

#include "base/counted.hpp"
#include "base/median.hpp"
#include "io/files/calibration_file.hpp"
#include "io/files/grey_levels.hpp"
#include "io/files/image_file.hpp"
#include "io/files/io_error.hpp"

namespace twofold {
namespace fs = std::filesystem;

namespace {
constexpr double kSupposedFocalLength = 1000;  // [px]
constexpr double kSupposedBaseline = 0.1;      // [m]

void take_intrinsics(bool from_file, SourceParameters& parameters, PinholeCamera& camera) {
  const bool supposed = !from_file && parameters.suppose_camera();
  if (supposed) camera.fx = camera.fy = kSupposedFocalLength;
  int taken = 0;
  for (const auto& [key, value] :
       {std::pair{"fx", &camera.fx}, {"fy", &camera.fy}, {"cx", &camera.cx}, {"cy", &camera.cy}}) {
    const auto given = parameters.take_number(key);
    if (!given && !from_file && !supposed) {
      throw IoError(parameters.subject(),
                    fmt::format("no calibration: give --calib FILE or fx, fy, cx, cy ('{}' is missing); "
                                "--calib auto finds one camera's lens",
                                key));
    }
    if (!given) continue;
    if (std::string_view(key) == "fy" && *given < 0)
      throw IoError(parameters.subject(),
                    fmt::format("fy={} is of axes whose y points up, as a renderer has them; images begin at "
                                "their top row: take fy={}",
                                *given, -*given));
    *value = *given;
    ++taken;
  }
  if (from_file && taken > 0 && taken < 4)  // a camera half of the one, half of the other
    throw IoError(parameters.subject(), "beside a calibration file: all of fx, fy, cx, cy, or none");
}

}  // namespace

Calibration with_parameters(Calibration base, bool from_file, SensorKind kind, SourceParameters& parameters) {
  const SensorKind base_kind = base.kind;
  Calibration calibration = std::move(base);
  calibration.kind = kind;
  const bool right_in_file = from_file && base_kind == SensorKind::kStereo;
  take_intrinsics(from_file, parameters, calibration.left.pinhole);
  if (const auto scale = parameters.take_positive("depth_scale")) calibration.depth_unit = 1.0 / *scale;
  if (const auto depth = parameters.take_positive("depth_min")) calibration.depth_min = *depth;
  if (const auto depth = parameters.take_positive("depth_max")) calibration.depth_max = *depth;
  if (const auto readout = parameters.take_number("readout")) calibration.readout = *readout;
  const auto baseline = parameters.take_positive("baseline");
  if (kind == SensorKind::kMono && baseline && !parameters.left_only())
    throw IoError(parameters.subject(), "parameter baseline: is for two cameras, but there is one");
  if (kind == SensorKind::kRgbd && baseline) calibration.virtual_baseline = *baseline;
  if (kind == SensorKind::kStereo && baseline) {
    calibration.right = calibration.left;
    calibration.T_right_left = SE3(SO3(), Vector3(-*baseline, 0, 0));
    // Nothing is left to be done; resampling the images would take its time.
    calibration.already_rectified = calibration.left.distortion.is_identity();
  } else if (kind == SensorKind::kStereo && !right_in_file && parameters.left_only()) {
    calibration.kind = SensorKind::kMono;
  } else if (kind == SensorKind::kStereo && !from_file && parameters.suppose_camera()) {
    calibration.right = calibration.left;
    calibration.T_right_left = SE3(SO3(), Vector3(-kSupposedBaseline, 0, 0));
    calibration.already_rectified = true;  // images come as they are
  } else if (kind == SensorKind::kStereo && !from_file) {
    throw IoError(parameters.subject(), "no calibration: stereo needs the parameter 'baseline'");
  }
  return calibration;
}

void note_long_intervals(const fs::path& file, Recording& recording) {
  constexpr std::size_t kFewest = 10;  // fewer may be photographs, taken one by one
  constexpr double kLong = 10;         // [s]
  const auto& frames = recording.frames;
  if (frames.size() < kFewest) return;
  std::vector<std::int64_t> intervals;
  for (std::size_t i = 1; i < frames.size(); ++i) intervals.push_back(frames[i].t_ns - frames[i - 1].t_ns);
  const double interval = static_cast<double>(median(std::span(intervals))) * 1e-9;
  if (interval <= kLong) return;
  recording.notes.push_back(
      fmt::format("{}: time stamps are taken as seconds, by which the frames are {:.6g} s apart",
                  file.string(), interval));
}

void take_truth(const std::function<Trajectory()>& read, Recording* recording) {
  try {
    recording->ground_truth = read();
  } catch (const IoError& e) {
    recording->notes.push_back(fmt::format("{}; the ground truth is left out", e.what()));
  }
}

Trajectory rectified_trajectory(const Trajectory& raw, const SO3& R_rectified_raw) {
  Trajectory rectified = raw;
  const SE3 T_raw_rectified(R_rectified_raw.inverse(), Vector3::Zero());
  for (TimedPose& pose : rectified) pose.T_w_c = pose.T_w_c * T_raw_rectified;
  return rectified;
}

namespace {

/// Bits of the grey levels: files of 16 bits often hold 8, 10, 12 or 14. One image alone may be a dark one:
/// some from all of the recording are looked at, if `first`, which can be read, is of 16.
int grey_bits_of(const std::vector<RecordedFrame>& frames, const fs::path& first) {
  constexpr std::size_t kLooks = 6;
  const std::optional<int> of_first = bits_used(first);
  if (!of_first) return 16;
  int bits = *of_first;
  for (std::size_t k = 1; k < kLooks; ++k) {
    try {
      bits = std::max(bits, bits_used(frames[k * (frames.size() - 1) / (kLooks - 1)].left).value_or(0));
    } catch (const IoError&) {  // is left out when it is that frame's turn
    }
  }
  return camera_bits(bits);
}

}  // namespace

PlaybackSource::PlaybackSource(Recording recording) : recording_(std::move(recording)) {
  if (recording_.frames.empty()) throw IoError(recording_.folder, "the recording holds no frames");
  const auto count = static_cast<std::int64_t>(recording_.frames.size());
  const FrameRange& range = recording_.range;
  range.expect_within(recording_.folder.string(), count);
  next_ = static_cast<std::size_t>(range.first);
  end_ = static_cast<std::size_t>(range.first + std::min(range.most, count - range.first));
  const cv::Mat first = first_image();
  const fs::path& first_file = recording_.frames[next_].left;
  grey_bits_ = grey_bits_of(recording_.frames, first_file);
  if (grey_bits_ < 16) recording_.notes.push_back(grey_levels_note(recording_.folder.string(), grey_bits_));
  take_size(first);
  expect_valid(recording_.calibration_file, recording_.calibration);
  expect_size(first_file, first, recording_.calibration.left.pinhole, left_said_by_);
  try {
    rectifier_.emplace(recording_.calibration);
  } catch (const std::runtime_error& e) {
    throw IoError(recording_.calibration_file, e.what());
  }
  if (const std::string black = rectifier_->black_note(); !black.empty())
    recording_.notes.push_back(recording_.calibration_file.string() + ": " + black);
  rig_ = rectifier_->rig();
  if (recording_.left_only && rig_.kind != SensorKind::kMono) {  // its images as the rig would have them
    rig_.kind = SensorKind::kMono;
    rig_.baseline = 0;
  }
  R_rectified_raw_ = rectifier_->R_rectified_left();
  ground_truth_ = rectified_trajectory(recording_.ground_truth, rectifier_->R_rectified_left());
}

SensorKind PlaybackSource::kind() const {
  return recording_.left_only ? SensorKind::kMono : recording_.calibration.kind;
}

void PlaybackSource::take_size(const cv::Mat& first) {
  Calibration& calibration = recording_.calibration;
  const std::string by_image = size_of_image(recording_.frames[next_].left);
  const std::string by_calibration = size_of_calibration(recording_.calibration_file);
  left_said_by_ = calibration.left.pinhole.width == 0 ? by_image : by_calibration;
  right_said_by_ = calibration.right.pinhole.width == 0 ? by_image : by_calibration;
  set_missing_size(recording_.calibration_file, first.cols, first.rows, &calibration);
}

Frame PlaybackSource::decode(const RecordedFrame& files) const {
  Frame frame;
  frame.t_ns = files.t_ns;
  frame.left = read_grey_image(files.left, grey_bits_);
  if (kind() == SensorKind::kStereo) frame.right = read_grey_image(files.right, grey_bits_);
  if (kind() == SensorKind::kRgbd) frame.depth = read_depth_image(files.depth);
  return frame;
}

void PlaybackSource::expect_sizes(const RecordedFrame& files, const Frame& frame) const {
  const Calibration& calibration = recording_.calibration;
  expect_size(files.left, frame.left, calibration.left.pinhole, left_said_by_);
  if (!frame.right.empty()) expect_size(files.right, frame.right, calibration.right.pinhole, right_said_by_);
  if (frame.depth.empty()) return;
  if (calibration.depth_apart)
    expect_size(files.depth, frame.depth, calibration.depth_camera.model.pinhole,
                size_of_calibration(recording_.calibration_file));
  else
    expect_size(files.depth, frame.depth, calibration.left.pinhole, left_said_by_);
}

void PlaybackSource::leave_out(const RecordedFrame& files, const IoError& error) {
  bool missing = false;
  const auto look_for = [&](const fs::path& image, const char* otherwise) {
    std::error_code ignored;
    if (fs::exists(image, ignored)) return;
    missing = true;
    if (const fs::path folder = image.parent_path(); !fs::is_directory(folder, ignored))
      throw IoError(folder, fmt::format("the folder is not there{}", otherwise));
  };
  constexpr const char* kAlone = " (--camera mono runs the left camera alone)";
  look_for(files.left, "");
  if (kind() == SensorKind::kStereo) look_for(files.right, kAlone);
  if (kind() == SensorKind::kRgbd) look_for(files.depth, kAlone);
  damaged_.leave_out(error);
  if (missing) ++missing_;
}

SourceReport PlaybackSource::report() const {
  SourceReport report;
  report.lost = recording_.alone + damaged_.count();
  report.notes = recording_.notes;
  report.faults = damaged_.lines();
  const std::string folder = recording_.folder.string();
  if (recording_.alone > 0)
    report.summary.push_back(
        fmt::format("{}: left out: {} without a partner", folder, counted(recording_.alone, "image")));
  if (missing_ > 0)
    report.summary.push_back(
        fmt::format("{}: left out: {} with a missing image", folder, counted(missing_, "frame")));
  if (const std::uint64_t damaged = damaged_.count() - missing_; damaged > 0)
    report.summary.push_back(
        fmt::format("{}: left out: {} with a damaged image", folder, counted(damaged, "frame")));
  return report;
}

cv::Mat PlaybackSource::colour_image(std::int64_t index) const {
  if (index < 0 || index >= static_cast<std::int64_t>(recording_.frames.size())) return {};
  const fs::path& file = recording_.frames[static_cast<std::size_t>(index)].left;
  const cv::Mat raw = read_colour_image(file);
  return raw.empty() ? raw : rectified_left(file, raw);
}

cv::Mat PlaybackSource::left_image(std::int64_t t_ns) const {
  const auto at = std::lower_bound(recording_.frames.begin(), recording_.frames.end(), t_ns,
                                   [](const RecordedFrame& frame, std::int64_t t) { return frame.t_ns < t; });
  if (at == recording_.frames.end() || at->t_ns != t_ns) return {};
  cv::Mat raw = read_colour_image(at->left);
  if (raw.empty()) raw = read_grey_image(at->left, grey_bits_);
  return rectified_left(at->left, raw);
}

cv::Mat PlaybackSource::rectified_left(const fs::path& file, const cv::Mat& raw) const {
  expect_size(file, raw, recording_.calibration.left.pinhole, left_said_by_);
  return rectifier_->rectified_left(raw);
}

cv::Mat PlaybackSource::first_image() {
  for (; next_ < end_; ++next_) {
    try {
      return read_grey_image(recording_.frames[next_].left);
    } catch (const IoError& error) {
      leave_out(recording_.frames[next_], error);
    }
  }
  damaged_.expect_any_frame();
  return {};
}

bool PlaybackSource::read_raw(Frame& raw) {
  while (next_ < end_) {
    const std::size_t index = next_++;
    const RecordedFrame& files = recording_.frames[index];
    try {
      raw = decode(files);
    } catch (const IoError& error) {
      leave_out(files, error);
      continue;
    }
    damaged_.frame_was_read();
    expect_sizes(files, raw);
    raw.index = static_cast<std::int64_t>(index);
    return true;
  }
  damaged_.expect_any_frame();
  return false;
}

bool PlaybackSource::read(Frame& frame) {
  Frame raw;
  if (!read_raw(raw)) return false;
  frame = Frame();  // its old images may still be held elsewhere: never write into them
  rectifier_->rectify(raw, frame);
  return true;
}

}  // namespace twofold
