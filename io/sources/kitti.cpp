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

std::vector<std::int64_t> read_times(const fs::path& file, std::size_t image_count) {
  std::vector<std::int64_t> times;
  std::int64_t previous = -1;
  for (const TextLine& line : read_text_lines(file)) {
    times.push_back(seconds_field(file, line.number, line.text));
    expect_increasing(file, line.number, times.back(), &previous);
  }
  if (times.size() != image_count) {
    throw IoError(file, fmt::format("has {} time stamps for {} images", times.size(), image_count));
  }
  return times;
}

void expect_pairs(const fs::path& folder, const std::vector<fs::path>& left,
                  const std::vector<fs::path>& right) {
  if (left.size() != right.size()) {
    throw IoError(folder, fmt::format("image_0 has {} images, image_1 has {}", left.size(), right.size()));
  }
  for (std::size_t i = 0; i < left.size(); ++i) {
    if (left[i].stem() != right[i].stem()) throw IoError(left[i], "has no image of the same name in image_1");
  }
}

Trajectory read_poses(const fs::path& file, const std::vector<std::int64_t>& times) {
  if (!fs::exists(file)) return {};
  Trajectory poses = read_kitti_trajectory(file);
  if (poses.size() != times.size()) {
    throw IoError(file, fmt::format("has {} poses for {} images", poses.size(), times.size()));
  }
  for (std::size_t i = 0; i < poses.size(); ++i) poses[i].t_ns = times[i];
  return poses;
}

}  // namespace

/// KITTI odometry: http://www.cvlibs.net/datasets/kitti/eval_odometry.php, one sequence's folder.
Recording read_kitti_recording(const fs::path& folder, const std::optional<fs::path>& calibration,
                               SourceParameters& parameters) {
  Recording recording;
  recording.folder = folder;
  recording.calibration_file = calibration.value_or(folder / "calib.txt");
  const auto left = list_images(folder / "image_0");
  const bool has_right = fs::exists(folder / "image_1");
  const bool stereo = has_right && !parameters.left_only();
  const auto right = stereo ? list_images(folder / "image_1") : std::vector<fs::path>{};
  if (stereo) expect_pairs(folder, left, right);

  recording.calibration = read_calibration(recording.calibration_file);
  if (stereo && recording.calibration.kind != SensorKind::kStereo) {
    throw IoError(recording.calibration_file,
                  "key 'P1' is missing: there is a folder image_1, but no right camera");
  }
  if (!has_right) recording.calibration.kind = SensorKind::kMono;

  const auto times = read_times(folder / "times.txt", left.size());
  for (std::size_t i = 0; i < left.size(); ++i) {
    recording.frames.push_back({times[i], left[i], stereo ? right[i] : fs::path(), {}});
  }
  note_long_intervals(folder / "times.txt", recording);
  recording.ground_truth = read_poses(folder / "poses.txt", times);
  return recording;
}

}  // namespace twofold
