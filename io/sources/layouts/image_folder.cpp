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

std::vector<std::int64_t> even_times(std::size_t count, double fps) {
  std::vector<std::int64_t> times;
  for (std::size_t i = 0; i < count; ++i) times.push_back(std::llround(static_cast<double>(i) / fps * 1e9));
  return times;
}

/// The i-th line of times.txt, that of `image`: "time", or as recordings of one camera for DSO have it "image
/// time ...", or as lists of TUM's layout "time image". The image is told by its name, or by its number,
/// which counts from `first`.
std::string_view time_in_line(const fs::path& file, const TextLine& line, const fs::path& image,
                              std::int64_t i, std::optional<std::int64_t> first) {
  const auto fields = split_fields(line.text);
  const auto is_the_image = [&](std::string_view field) {
    return field == image.stem().string() || fs::path(field).filename() == image.filename();
  };
  if (fields.size() == 1) return fields[0];
  if (is_the_image(fields[1])) return fields[0];
  if (is_the_image(fields[0]) || (first && to_integer(fields[0]) == *first + i)) return fields[1];
  throw IoError(file, line.number,
                fmt::format("is none of 'time', 'image time ...', 'time image', where the image is {}",
                            image.filename().string()));
}

std::vector<std::int64_t> read_image_times(const fs::path& file, const std::vector<fs::path>& images) {
  if (!fs::exists(file))
    throw IoError(file, "no such file: give the images' times there, or the parameter fps");
  const auto lines = read_table_lines(file);
  if (lines.size() != images.size())
    throw IoError(file, fmt::format("has {} time stamps for {} images", lines.size(), images.size()));
  const auto first = to_integer(split_fields(lines[0].text)[0]);
  std::vector<std::int64_t> times;
  std::int64_t previous = -1;
  for (std::size_t i = 0; i < lines.size(); ++i) {
    const std::string_view time =
        time_in_line(file, lines[i], images[i], static_cast<std::int64_t>(i), first);
    times.push_back(seconds_field(file, lines[i].number, time));
    expect_increasing(file, lines[i].number, times.back(), &previous);
  }
  return times;
}

/// Image files of one camera beside the left one.
struct OtherCamera {
  SensorKind kind = SensorKind::kMono;  ///< of both together
  std::vector<fs::path> files;          ///< empty when nobody looks at them
};

OtherCamera list_other_camera(const fs::path& folder, bool left_only) {
  const auto list = [&](const char* name) {
    return left_only ? std::vector<fs::path>() : list_images(folder / name);
  };
  if (fs::is_directory(folder / "right")) return {SensorKind::kStereo, list("right")};
  if (fs::is_directory(folder / "depth")) return {SensorKind::kRgbd, list("depth")};
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

/// By name; by position only where the names say nothing and there are as many of each.
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
    if (kind == SensorKind::kStereo && base.kind != SensorKind::kStereo && !parameters.left_only()) {
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
  const OtherCamera other = has_sides ? list_other_camera(folder, parameters.left_only()) : OtherCamera();
  const auto fps = parameters.take_positive("fps");
  const auto times = fps ? even_times(left.size(), *fps) : read_image_times(folder / "times.txt", left);
  if (other.files.empty()) {
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
  if (!fps) note_long_intervals(folder / "times.txt", recording);
  recording.calibration =
      folder_calibration(folder, calibration, other.kind, parameters, &recording.calibration_file);
  if (const fs::path truth = folder / "groundtruth.txt"; fs::exists(truth)) {
    take_truth([&] { return read_tum_trajectory(truth); }, &recording);
  }
  return recording;
}

}  // namespace twofold
