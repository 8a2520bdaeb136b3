#include <algorithm>

#include <fmt/format.h>

#include "io/files/calibration_file.hpp"
#include "io/files/io_error.hpp"
#include "io/files/text_file.hpp"
#include "io/files/trajectory_file.hpp"
#include "io/sources/recording.hpp"

namespace twofold {
namespace {

namespace fs = std::filesystem;

struct StampedImage {
  std::int64_t t_ns = 0;
  fs::path file;
};

/// data.csv: lines "time [ns],file name in data/".
std::vector<StampedImage> read_image_list(const fs::path& camera_folder) {
  const fs::path file = camera_folder / "data.csv";
  std::vector<StampedImage> images;
  std::int64_t previous = -1;
  for (const TextLine& line : read_text_lines(file)) {
    const auto fields = split_fields(line.text, ", \t");
    if (fields.size() != 2) throw IoError(file, line.number, "is not 'time,file'");
    images.push_back({nanoseconds_field(file, line.number, fields[0]), camera_folder / "data" / fields[1]});
    expect_increasing(file, line.number, images.back().t_ns, &previous);
  }
  if (images.empty()) throw IoError(file, "lists no images");
  return images;
}

std::vector<RecordedFrame> pair_images(const fs::path& mav, const std::vector<StampedImage>& left,
                                       const std::vector<StampedImage>& right, bool drop_unpaired) {
  if (left.size() != right.size() && !drop_unpaired) {
    throw IoError(mav, fmt::format("cam0 lists {} images, cam1 {} (unpaired=drop keeps the pairs)",
                                   left.size(), right.size()));
  }
  std::vector<RecordedFrame> frames;
  auto match = right.begin();
  for (const StampedImage& image : left) {
    match =
        std::find_if(match, right.end(), [&](const StampedImage& other) { return other.t_ns >= image.t_ns; });
    if (match != right.end() && match->t_ns == image.t_ns) {
      frames.push_back({image.t_ns, image.file, match->file, {}});
    } else if (!drop_unpaired) {
      throw IoError(image.file, "cam1 has no image of the same time (unpaired=drop keeps the pairs)");
    }
  }
  return frames;
}

/// The ground truth is of its own sensor S; its sensor.yaml, if there, says where that sits in the body.
Trajectory read_truth(const fs::path& folder, const SE3& T_b_c) {
  if (!fs::exists(folder / "data.csv")) return {};
  SE3 T_b_s;
  if (fs::exists(folder / "sensor.yaml")) {
    T_b_s = read_euroc_sensor_pose(folder / "sensor.yaml");
  }
  Trajectory truth = read_euroc_trajectory(folder / "data.csv");
  for (TimedPose& pose : truth) pose.T_w_c = pose.T_w_c * T_b_s.inverse() * T_b_c;
  return truth;
}

}  // namespace

/// EuRoC / ASL layout: https://projects.asl.ethz.ch/datasets/doku.php?id=kmavvisualinertialdatasets
Recording read_euroc_recording(const fs::path& folder, const std::optional<fs::path>& calibration,
                               SourceParameters& parameters) {
  const fs::path mav = fs::exists(folder / "mav0") ? folder / "mav0" : folder;
  const bool stereo = fs::exists(mav / "cam1");
  const bool drop_unpaired = parameters.take_drop_unpaired();
  Recording recording;
  recording.folder = folder;
  recording.calibration_file = calibration.value_or(mav / "cam0" / "sensor.yaml");

  SE3 T_b_c;
  if (fs::exists(mav / "cam0" / "sensor.yaml")) T_b_c = read_euroc_camera(mav / "cam0" / "sensor.yaml").T_b_c;
  if (!calibration && stereo) {
    recording.calibration = read_euroc_calibration(recording.calibration_file, mav / "cam1" / "sensor.yaml");
  } else {
    recording.calibration = read_calibration(recording.calibration_file);
    if (stereo && recording.calibration.kind != SensorKind::kStereo) {
      throw IoError(recording.calibration_file, "is not for a stereo camera, but there is a folder cam1");
    }
  }

  const auto left = read_image_list(mav / "cam0");
  if (stereo) {
    recording.frames = pair_images(mav, left, read_image_list(mav / "cam1"), drop_unpaired);
  } else {
    recording.calibration.kind = SensorKind::kMono;
    for (const StampedImage& image : left) recording.frames.push_back({image.t_ns, image.file, {}, {}});
  }
  recording.ground_truth = read_truth(mav / "state_groundtruth_estimate0", T_b_c);
  return recording;
}

}  // namespace twofold
