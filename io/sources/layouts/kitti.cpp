#include <algorithm>
#include <map>

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

/// Image files of each name that one of the cameras has, in the order of the names. The other's file may be
/// missing, which whoever reads it is told. Where hardly any name is of both it is no pair of cameras.
std::vector<RecordedFrame> pair_images(const fs::path& folder, const Cameras& cameras,
                                       const std::vector<fs::path>& left,
                                       const std::vector<fs::path>& right) {
  std::map<fs::path, RecordedFrame> by_stem;
  for (const fs::path& file : left) by_stem[file.stem()].left = file;
  for (const fs::path& file : right) by_stem[file.stem()].right = file;
  const std::size_t of_both = left.size() + right.size() - by_stem.size();
  if (2 * of_both < std::min(left.size(), right.size()))
    throw IoError(folder, fmt::format("of {} images in {} and {} in {} only {} have the same name",
                                      left.size(), cameras.left, right.size(), cameras.right, of_both));
  std::vector<fs::path> names;
  for (auto& [stem, frame] : by_stem) {
    if (frame.left.empty()) frame.left = folder / cameras.left / frame.right.filename();
    if (frame.right.empty()) frame.right = folder / cameras.right / frame.left.filename();
    names.push_back(frame.left);
  }
  sort_images(names);
  std::vector<RecordedFrame> frames;
  for (const fs::path& name : names) frames.push_back(by_stem[name.stem()]);
  return frames;
}

/// Without their times yet.
std::vector<RecordedFrame> list_frames(const fs::path& folder, const Cameras& cameras, bool stereo) {
  const auto left = list_images(folder / cameras.left);
  if (stereo) return pair_images(folder, cameras, left, list_images(folder / cameras.right));
  std::vector<RecordedFrame> frames;
  for (const fs::path& file : left) frames.push_back({0, file, {}, {}});
  return frames;
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
  const bool has_right = fs::exists(folder / cameras.right);
  const bool stereo = has_right && !parameters.left_only();
  recording.frames = list_frames(folder, cameras, stereo);

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

  const auto times = read_times(folder / "times.txt", recording.frames.size());
  for (std::size_t i = 0; i < times.size(); ++i) recording.frames[i].t_ns = times[i];
  note_long_intervals(folder / "times.txt", recording);
  take_poses(cameras, times, &recording);
  return recording;
}

}  // namespace twofold
