#include <fmt/format.h>

#include "io/files/calibration_file.hpp"
#include "io/files/image_file.hpp"
#include "io/files/io_error.hpp"
#include "io/files/kitti_calibration.hpp"
#include "io/files/text_file.hpp"
#include "io/files/trajectory_file.hpp"
#include "io/sources/recording.hpp"

namespace twofold {
namespace {

namespace fs = std::filesystem;

std::vector<std::int64_t> read_times(const fs::path& file, std::size_t image_count) {
  if (!fs::exists(file))
    throw IoError(file, "no such file: data_odometry_calib.zip of KITTI has it beside calib.txt");
  std::vector<std::int64_t> times;
  std::int64_t previous = -1;
  for (const TextLine& line : read_table_lines(file)) {
    times.push_back(seconds_field(file, line.number, line.text));
    expect_increasing(file, line.number, times.back(), &previous);
  }
  if (times.size() != image_count) {
    throw IoError(file, fmt::format("has {} time stamps for {} images", times.size(), image_count));
  }
  return times;
}

/// Folders of the images, and the cameras in calib.txt that took them.
struct Cameras {
  const char* left;
  const char* right;
  const char* right_key;
  KittiPair pair;
};

/// Grey where both are there.
Cameras cameras_in(const fs::path& folder) {
  if (!fs::exists(folder / "image_0") && fs::exists(folder / "image_2"))
    return {"image_2", "image_3", "P3", KittiPair::kColour};
  return {"image_0", "image_1", "P1", KittiPair::kGrey};
}

void expect_pairs(const fs::path& folder, const Cameras& cameras, const std::vector<fs::path>& left,
                  const std::vector<fs::path>& right) {
  if (left.size() != right.size()) {
    throw IoError(folder, fmt::format("{} has {} images, {} has {}", cameras.left, left.size(), cameras.right,
                                      right.size()));
  }
  for (std::size_t i = 0; i < left.size(); ++i) {
    if (left[i].stem() != right[i].stem())
      throw IoError(left[i], fmt::format("has no image of the same name in {}", cameras.right));
  }
}

Calibration read_cameras(const fs::path& file, const Cameras& cameras) {
  std::error_code ignored;
  if (fs::is_regular_file(file, ignored) && looks_like_kitti_calibration(file))
    return read_kitti_calibration(file, cameras.pair);
  return read_calibration(file);
}

/// poses.txt in the sequence's folder, or poses/NN.txt beside the sequences/NN of the benchmark's own layout.
/// Empty: neither is there.
fs::path poses_file(const fs::path& folder) {
  if (fs::exists(folder / "poses.txt")) return folder / "poses.txt";
  const fs::path sequence = (fs::absolute(folder) / "").lexically_normal().parent_path();
  if (sequence.parent_path().filename() != "sequences") return {};
  const fs::path file =
      sequence.parent_path().parent_path() / "poses" / (sequence.filename().string() + ".txt");
  return fs::exists(file) ? file : fs::path();
}

/// Poses are those of the left grey camera; `T_grey_left` takes them to the one whose images are played.
Trajectory read_poses(const fs::path& file, const std::vector<std::int64_t>& times, const SE3& T_grey_left) {
  Trajectory poses = read_kitti_trajectory(file);
  if (poses.size() != times.size()) {
    throw IoError(file, fmt::format("has {} poses for {} images", poses.size(), times.size()));
  }
  for (std::size_t i = 0; i < poses.size(); ++i) poses[i] = {times[i], poses[i].T_w_c * T_grey_left};
  return poses;
}

void take_poses(const Cameras& cameras, const std::vector<std::int64_t>& times, Recording* recording) {
  const fs::path file = poses_file(recording->folder);
  if (file.empty()) return;
  take_truth(
      [&] {
        SE3 T_grey_left;
        if (cameras.pair == KittiPair::kColour)
          T_grey_left = read_kitti_colour_in_grey(recording->folder / "calib.txt");
        return read_poses(file, times, T_grey_left);
      },
      recording);
}

}  // namespace

/// KITTI odometry: http://www.cvlibs.net/datasets/kitti/eval_odometry.php, one sequence's folder.
Recording read_kitti_recording(const fs::path& folder, const std::optional<fs::path>& calibration,
                               SourceParameters& parameters) {
  Recording recording;
  recording.folder = folder;
  recording.calibration_file = calibration.value_or(folder / "calib.txt");
  const Cameras cameras = cameras_in(folder);
  const auto left = list_images(folder / cameras.left);
  const bool has_right = fs::exists(folder / cameras.right);
  const bool stereo = has_right && !parameters.left_only();
  const auto right = stereo ? list_images(folder / cameras.right) : std::vector<fs::path>{};
  if (stereo) expect_pairs(folder, cameras, left, right);

  if (!calibration && !fs::exists(recording.calibration_file))
    throw IoError(
        recording.calibration_file,
        "no such calibration file: data_odometry_calib.zip of KITTI has it, and times.txt; or --calib");
  recording.calibration = read_cameras(recording.calibration_file, cameras);
  if (stereo && recording.calibration.kind != SensorKind::kStereo) {
    throw IoError(recording.calibration_file,
                  calibration
                      ? fmt::format("is not for a stereo camera, but there is a folder {}", cameras.right)
                      : fmt::format("key '{}' is missing: there is a folder {}, but no right camera",
                                    cameras.right_key, cameras.right));
  }
  if (!has_right) recording.calibration.kind = SensorKind::kMono;

  const auto times = read_times(folder / "times.txt", left.size());
  for (std::size_t i = 0; i < left.size(); ++i) {
    recording.frames.push_back({times[i], left[i], stereo ? right[i] : fs::path(), {}});
  }
  note_long_intervals(folder / "times.txt", recording);
  take_poses(cameras, times, &recording);
  return recording;
}

}  // namespace twofold
