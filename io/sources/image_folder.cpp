#include <fmt/format.h>

#include "io/files/calibration_file.hpp"
#include "io/files/image_file.hpp"
#include "io/files/io_error.hpp"
#include "io/files/text_file.hpp"
#include "io/files/trajectory_file.hpp"
#include "io/sources/recording.hpp"

namespace twofold {
namespace {

namespace fs = std::filesystem;

/// times.txt (seconds, a line an image), or images i / fps.
std::vector<std::int64_t> image_times(const fs::path& folder, std::size_t count,
                                      SourceParameters& parameters) {
  const auto fps = parameters.take_number("fps");
  if (fps && *fps <= 0) throw IoError(parameters.subject(), fmt::format("fps={} must be positive", *fps));
  const fs::path file = folder / "times.txt";
  std::vector<std::int64_t> times;
  if (fps) {
    for (std::size_t i = 0; i < count; ++i)
      times.push_back(std::llround(static_cast<double>(i) / *fps * 1e9));
    return times;
  }
  if (!fs::exists(file))
    throw IoError(file, "no such file: give the images' times there, or the parameter fps");
  std::int64_t previous = -1;
  for (const TextLine& line : read_text_lines(file)) {
    const auto fields = split_fields(line.text);
    times.push_back(seconds_field(file, line.number, fields[0]));
    expect_increasing(file, line.number, times.back(), &previous);
  }
  if (times.size() != count)
    throw IoError(file, fmt::format("has {} time stamps for {} images", times.size(), count));
  return times;
}

Calibration folder_calibration(const fs::path& folder, const std::optional<fs::path>& given, SensorKind kind,
                               SourceParameters& parameters, fs::path* source) {
  *source = given.value_or(folder / "calibration.yaml");
  const bool from_file = given || fs::exists(*source);
  if (!from_file) *source = parameters.subject();
  Calibration base;
  if (from_file) {
    base = read_calibration(*source);
    if (kind == SensorKind::kStereo && base.kind != SensorKind::kStereo) {
      throw IoError(*source, "is not for a stereo camera, but there is a folder right");
    }
  }
  return with_parameters(std::move(base), from_file, kind, parameters);
}

}  // namespace

Recording read_image_folder(const fs::path& folder, const std::optional<fs::path>& calibration,
                            SourceParameters& parameters) {
  Recording recording;
  recording.folder = folder;
  const bool has_sides = fs::is_directory(folder / "left");
  const auto left = list_images(has_sides ? folder / "left" : folder);
  SensorKind kind = SensorKind::kMono;
  std::vector<fs::path> other;
  if (has_sides && fs::is_directory(folder / "right")) {
    kind = SensorKind::kStereo;
    other = list_images(folder / "right");
  } else if (has_sides && fs::is_directory(folder / "depth")) {
    kind = SensorKind::kRgbd;
    other = list_images(folder / "depth");
  }
  if (kind != SensorKind::kMono && other.size() != left.size()) {
    throw IoError(folder, fmt::format("left has {} images, {} has {}", left.size(),
                                      other[0].parent_path().filename().string(), other.size()));
  }
  const auto times = image_times(folder, left.size(), parameters);
  for (std::size_t i = 0; i < left.size(); ++i) {
    RecordedFrame frame{times[i], left[i], {}, {}};
    if (kind == SensorKind::kStereo) frame.right = other[i];
    if (kind == SensorKind::kRgbd) frame.depth = other[i];
    recording.frames.push_back(std::move(frame));
  }
  recording.calibration =
      folder_calibration(folder, calibration, kind, parameters, &recording.calibration_file);
  if (const fs::path truth = folder / "groundtruth.txt"; fs::exists(truth)) {
    recording.ground_truth = read_tum_trajectory(truth);
  }
  return recording;
}

}  // namespace twofold
