#include <algorithm>

#include <fmt/format.h>

#include "io/files/calibration_file.hpp"
#include "io/files/image_file.hpp"
#include "io/files/image_pairs.hpp"
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

/// Image files of one camera beside the left one.
struct OtherCamera {
  SensorKind kind = SensorKind::kMono;  ///< of both together
  std::vector<fs::path> files;
};

OtherCamera list_other_camera(const fs::path& folder) {
  if (fs::is_directory(folder / "right")) return {SensorKind::kStereo, list_images(folder / "right")};
  if (fs::is_directory(folder / "depth")) return {SensorKind::kRgbd, list_images(folder / "depth")};
  return {};
}

/// Throws IoError that names the first image whose place `taken` does not mark.
void expect_all_taken(const std::vector<fs::path>& files, const std::vector<bool>& taken,
                      const std::string& others) {
  const auto alone = std::find(taken.begin(), taken.end(), false);
  if (alone == taken.end()) return;
  throw IoError(
      files[static_cast<std::size_t>(alone - taken.begin())],
      fmt::format("{} has no image of the same name or number (unpaired=drop keeps the pairs)", others));
}

/// By name; by position only where the names say nothing and the numbers of images agree.
ImagePairs pair_images(const fs::path& folder, const std::vector<fs::path>& left,
                       const std::vector<fs::path>& other, bool drop_unpaired) {
  ImagePairs pairs = pairs_by_name(left, other);
  const std::string others = other[0].parent_path().filename().string();
  if (pairs.empty()) {
    if (other.size() != left.size())
      throw IoError(folder, fmt::format("left has {} images, {} has {}", left.size(), others, other.size()));
    for (std::size_t i = 0; i < left.size(); ++i) pairs.emplace_back(i, i);
  }
  if (drop_unpaired) return pairs;
  std::vector<bool> left_taken(left.size()), other_taken(other.size());
  for (const auto& [l, o] : pairs) left_taken[l] = other_taken[o] = true;
  expect_all_taken(left, left_taken, others);
  expect_all_taken(other, other_taken, "left");
  return pairs;
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
  const bool drop_unpaired = parameters.take_drop_unpaired();
  const auto left = list_images(has_sides ? folder / "left" : folder);
  const OtherCamera other = has_sides ? list_other_camera(folder) : OtherCamera();
  const auto times = image_times(folder, left.size(), parameters);
  if (other.kind == SensorKind::kMono) {
    for (std::size_t i = 0; i < left.size(); ++i) recording.frames.push_back({times[i], left[i], {}, {}});
  } else {
    const auto pairs = pair_images(folder, left, other.files, drop_unpaired);
    for (const auto& [l, o] : pairs) {
      RecordedFrame frame{times[l], left[l], {}, {}};
      (other.kind == SensorKind::kStereo ? frame.right : frame.depth) = other.files[o];
      recording.frames.push_back(std::move(frame));
    }
    recording.alone = left.size() + other.files.size() - 2 * pairs.size();
  }
  recording.calibration =
      folder_calibration(folder, calibration, other.kind, parameters, &recording.calibration_file);
  if (const fs::path truth = folder / "groundtruth.txt"; fs::exists(truth)) {
    recording.ground_truth = read_tum_trajectory(truth);
  }
  return recording;
}

}  // namespace twofold
