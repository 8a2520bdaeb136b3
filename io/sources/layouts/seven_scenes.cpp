#include <algorithm>

#include <fmt/format.h>

#include "io/files/io_error.hpp"
#include "io/files/trajectory_file.hpp"
#include "io/sources/layouts/numbered_frames.hpp"

namespace twofold {
namespace {

namespace fs = std::filesystem;

constexpr const char* kFrame = "frame-";
constexpr double kSevenScenesFps = 30;
constexpr double kNoReading = 65535;  // of a depth image [units]

/// A file an image; those that are not there, and those without a pose, are left out.
Trajectory read_scene_poses(const std::vector<NumberedFile>& images, const fs::path& folder, double fps) {
  Trajectory poses;
  for (const NumberedFile& image : images) {
    const std::string name = image.file.filename().string();
    const fs::path file = folder / (name.substr(0, name.find('.')) + ".pose.txt");
    if (!fs::exists(file)) continue;
    if (const auto T_w_c = read_pose_matrix(file)) poses.push_back({time_of_number(image, fps), *T_w_c});
  }
  return poses;
}

}  // namespace

bool is_seven_scenes(const fs::path& folder) {
  return has_numbered(folder, kFrame, {".color.png"});
}

/// 7-Scenes: https://www.microsoft.com/en-us/research/project/rgb-d-dataset-7-scenes, one sequence's folder.
Recording read_seven_scenes(const fs::path& folder, const std::optional<fs::path>& calibration,
                            SourceParameters& parameters) {
  Recording recording;
  recording.folder = folder;
  const double fps = take_numbered_fps(kSevenScenesFps, parameters);
  const auto colour = list_numbered(folder, kFrame, {".color.png"});
  if (colour.empty()) throw IoError(folder, "holds no images called frame-NUMBER.color.png");
  take_numbered_frames(colour, list_numbered(folder, kFrame, {".depth.png"}), fps, parameters, &recording);
  const auto published = [&]() -> std::optional<Calibration> {
    if (parameters.suppose_camera()) return std::nullopt;
    return take_published_camera(PublicDataset::kSevenScenes, &recording);
  };
  take_numbered_calibration(calibration, published, 0.001, parameters, &recording);
  // However far the user believes the sensor.
  const double farthest = (kNoReading - 0.5) * recording.calibration.depth_unit;
  recording.calibration.depth_max = std::min(recording.calibration.depth_max, farthest);
  take_truth([&] { return read_scene_poses(colour, folder, fps); }, &recording);
  return recording;
}

}  // namespace twofold
