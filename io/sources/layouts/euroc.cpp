#include <algorithm>

#include <fmt/format.h>

#include "io/files/calibration_file.hpp"
#include "io/files/image_pairs.hpp"
#include "io/files/io_error.hpp"
#include "io/files/text_file.hpp"
#include "io/files/trajectory_file.hpp"
#include "io/sources/recording.hpp"

namespace twofold {
namespace {

namespace fs = std::filesystem;

constexpr double kMaxGap =
    0.001;  // [s]; cameras that one pulse triggers stamp their images that far apart at most

/// data.csv: lines "time [ns],file name in data/".
std::vector<StampedFile> read_image_list(const fs::path& camera_folder) {
  const fs::path file = camera_folder / "data.csv";
  std::vector<StampedFile> images;
  std::int64_t previous = -1;
  for (const TextLine& line : read_table_lines(file)) {
    const auto fields = split_fields(line.text, ", \t");
    if (fields.size() != 2) throw IoError(file, line.number, "is not 'time,file'");
    images.push_back({nanoseconds_field(file, line.number, fields[0]), camera_folder / "data" / fields[1]});
    expect_increasing(file, line.number, images.back().t_ns, &previous);
  }
  if (images.empty()) throw IoError(file, "lists no images");
  return images;
}

/// How the images of the two cameras find together.
struct PairingRule {
  std::int64_t max_gap_ns = 0;
  bool drop_unpaired = false;
};

/// Where a camera did not deliver an image now and then, as in V2_03_difficult, there is no pair. Where most
/// images have no partner it is the pairing that is wrong.
void pair_images(const fs::path& mav, const std::vector<StampedFile>& left,
                 const std::vector<StampedFile>& right, const PairingRule& pairing, Recording& recording) {
  const ImagePairs pairs = pairs_by_time(left, right, pairing.max_gap_ns);
  const std::size_t fewer = std::min(left.size(), right.size());
  const std::string gap = fmt::format("{:g} s (max_gap)", static_cast<double>(pairing.max_gap_ns) * 1e-9);
  if (pairs.empty()) throw IoError(mav, "no images of cam0 and cam1 are within " + gap);
  if (2 * pairs.size() < fewer && !pairing.drop_unpaired) {
    throw IoError(mav, fmt::format("of {} images of cam0 and {} of cam1 only {} are within {} of one of the "
                                   "other (unpaired=drop keeps these pairs)",
                                   left.size(), right.size(), pairs.size(), gap));
  }
  for (const auto& [l, r] : pairs)
    recording.frames.push_back({left[l].t_ns, left[l].file, right[r].file, {}});
  recording.alone = left.size() + right.size() - 2 * pairs.size();
}

/// The truth is of its own sensor S; a sensor.yaml beside it, if there, says where that sits in the body.
Trajectory read_truth_of_camera(const fs::path& file, const SE3& T_b_c) {
  SE3 T_b_s;
  if (const fs::path sensor = file.parent_path() / "sensor.yaml"; fs::exists(sensor))
    T_b_s = read_euroc_sensor_pose(sensor);
  Trajectory truth = read_euroc_trajectory(file);
  for (TimedPose& pose : truth) pose.T_w_c = pose.T_w_c * T_b_s.inverse() * T_b_c;
  return truth;
}

std::optional<SE3> camera_in_body(const fs::path& mav, const std::optional<fs::path>& calibration) {
  std::optional<SE3> T_b_c;
  if (const fs::path sensor = mav / "cam0" / "sensor.yaml"; fs::exists(sensor))
    T_b_c = read_camera_in_body(sensor);
  if (!T_b_c && calibration) T_b_c = read_camera_in_body(*calibration);
  return T_b_c;
}

SO3 rectifying_turn(const fs::path& mav, const Calibration& calibration) {
  try {
    return Rectifier(calibration).R_rectified_left();
  } catch (const std::runtime_error& e) {
    throw IoError(mav, e.what());
  }
}

/// Empty: there is none.
fs::path truth_file(const fs::path& mav) {
  for (const char* sensor : {"state_groundtruth_estimate0", "mocap0"})
    if (fs::exists(mav / sensor / "data.csv")) return mav / sensor / "data.csv";
  return {};
}

/// state_groundtruth_estimate0/data.csv, or else TUM-VI's mocap0/data.csv. Their poses are the body's (the
/// IMU's).
void take_euroc_truth(const fs::path& mav, const std::optional<fs::path>& calibration, Recording* recording) {
  const fs::path file = truth_file(mav);
  if (file.empty()) return;
  const auto read = [&] {
    const auto T_b_c = camera_in_body(mav, calibration);
    if (!T_b_c)
      throw IoError(file,
                    "its poses are the body's, and nothing says how the camera sits in it (T_BS of "
                    "cam0/sensor.yaml, or --calib with T_cam_imu)");
    return read_truth_of_camera(file, *T_b_c);
  };
  take_truth(read, recording);
}

}  // namespace

/// EuRoC / ASL layout: https://projects.asl.ethz.ch/datasets/doku.php?id=kmavvisualinertialdatasets
Recording read_euroc_recording(const fs::path& folder, const std::optional<fs::path>& calibration,
                               SourceParameters& parameters) {
  const fs::path mav = fs::exists(folder / "mav0") ? folder / "mav0" : folder;
  if (!fs::exists(mav / "cam0" / "data.csv") && mav == folder)
    throw IoError(folder, "holds neither mav0 nor cam0/data.csv, as EuRoC's recordings do");
  const bool has_right = fs::exists(mav / "cam1");
  const bool stereo = has_right && !parameters.left_only();
  const bool right_known = stereo || (has_right && fs::exists(mav / "cam1" / "sensor.yaml"));
  const PairingRule pairing{parameters.take_max_gap_ns(kMaxGap), parameters.take_drop_unpaired()};
  Recording recording;
  recording.folder = folder;
  recording.calibration_file = calibration.value_or(mav / "cam0" / "sensor.yaml");

  if (!calibration && right_known) {
    recording.calibration = read_euroc_calibration(recording.calibration_file, mav / "cam1" / "sensor.yaml");
  } else {
    recording.calibration = read_calibration(recording.calibration_file);
    if (stereo && recording.calibration.kind != SensorKind::kStereo) {
      throw IoError(recording.calibration_file, "is not for a stereo camera, but there is a folder cam1");
    }
  }

  const auto left = read_image_list(mav / "cam0");
  if (stereo) {
    pair_images(mav, left, read_image_list(mav / "cam1"), pairing, recording);
  } else {
    if (!has_right) recording.calibration.kind = SensorKind::kMono;
    for (const StampedFile& image : left) recording.frames.push_back({image.t_ns, image.file, {}, {}});
  }
  take_euroc_truth(mav, calibration, &recording);
  return recording;
}

std::optional<Trajectory> read_euroc_truth_of_camera(const fs::path& file) {
  const fs::path mav = fs::absolute(file).lexically_normal().parent_path().parent_path();
  const auto T_b_c = camera_in_body(mav, {});
  if (!T_b_c) return std::nullopt;
  const Calibration calibration = read_calibration(mav);
  expect_valid(mav, calibration);
  return rectified_trajectory(read_truth_of_camera(file, *T_b_c), rectifying_turn(mav, calibration));
}

}  // namespace twofold
