#include <cmath>
#include <fstream>
#include <nlohmann/json.hpp>

#include <fmt/format.h>

#include "io/files/io_error.hpp"
#include "io/files/trajectory_file.hpp"
#include "io/sources/layouts/numbered_frames.hpp"

namespace twofold {
namespace {

namespace fs = std::filesystem;

constexpr double kReplicaFps = 30;                  // rendered; nobody says how fast
constexpr double kReplicaDepthUnit = 1.0 / 6553.5;  // where no cam_params.json says it [m]

/// In the scene's folder, or beside it for all scenes. Empty: it is not there.
fs::path camera_file(const fs::path& folder) {
  const fs::path above = (fs::absolute(folder) / "").lexically_normal().parent_path().parent_path();
  for (const fs::path& place : {folder, above})
    if (fs::exists(place / "cam_params.json")) return place / "cam_params.json";
  return {};
}

/// {"camera": {"w": 1200, "h": 680, "fx": 600.0, "fy": .., "cx": .., "cy": .., "scale": 6553.5}}
Calibration read_cam_params(const fs::path& file) {
  std::ifstream stream(file);
  const auto root = nlohmann::json::parse(stream, nullptr, false);
  const auto camera = root.is_object() ? root.find("camera") : root.end();
  if (root.is_discarded() || !root.is_object() || camera == root.end() || !camera->is_object())
    throw IoError(file, "is no JSON file with a camera");
  const auto number = [&](const char* key) {
    const auto value = camera->find(key);
    if (value == camera->end() || !value->is_number() || !std::isfinite(value->get<double>()))
      throw IoError(file, fmt::format("key 'camera.{}' is missing, or no number", key));
    return value->get<double>();
  };
  const double width = number("w"), height = number("h"), scale = number("scale");
  if (!(width > 0 && width < 1e5 && height > 0 && height < 1e5)) throw IoError(file, "impossible w or h");
  if (!(scale > 0)) throw IoError(file, fmt::format("key 'camera.scale' is {}, must be positive", scale));
  Calibration calibration;
  calibration.left.pinhole = {number("fx"),
                              number("fy"),
                              number("cx"),
                              number("cy"),
                              static_cast<int>(width),
                              static_cast<int>(height)};
  calibration.depth_unit = 1.0 / scale;
  calibration.depth_unit_stated = true;
  calibration.readout = 0;
  return calibration;
}

/// A line an image, by the image's number.
Trajectory read_scene_path(const fs::path& file, const std::vector<NumberedFile>& images, double fps) {
  const Trajectory by_line = read_matrix_trajectory(file);
  Trajectory poses;
  for (const NumberedFile& image : images) {
    const auto line = static_cast<std::size_t>(image.number);
    if (line >= by_line.size())
      throw IoError(file,
                    fmt::format("has {} poses, none for {}", by_line.size(), image.file.filename().string()));
    poses.push_back({time_of_number(image, fps), by_line[line].T_w_c});
  }
  return poses;
}

}  // namespace

bool is_replica(const fs::path& folder) {
  return has_numbered(folder / "results", "frame", {".jpg", ".png"});
}

/// Replica as rendered for iMAP and handed on with NICE-SLAM: https://github.com/cvg/nice-slam, one scene's
/// folder.
Recording read_replica(const fs::path& folder, const std::optional<fs::path>& calibration,
                       SourceParameters& parameters) {
  Recording recording;
  recording.folder = folder;
  const double fps = take_numbered_fps(kReplicaFps, parameters);
  const auto colour = list_numbered(folder / "results", "frame", {".jpg", ".png"});
  if (colour.empty()) throw IoError(folder / "results", "holds no images called frameNUMBER.jpg");
  const auto depth = list_numbered(folder / "results", "depth", {".png"});
  take_numbered_frames(colour, depth, fps, parameters, &recording);
  const auto own = [&]() -> std::optional<Calibration> {
    if (const fs::path file = camera_file(folder); !file.empty()) {
      recording.calibration_file = file;
      return read_cam_params(file);
    }
    if (parameters.suppose_camera()) return std::nullopt;
    return take_published_camera(PublicDataset::kReplica, &recording);
  };
  take_numbered_calibration(calibration, own, kReplicaDepthUnit, parameters, &recording);
  if (const fs::path truth = folder / "traj.txt"; fs::exists(truth))
    take_truth([&] { return read_scene_path(truth, colour, fps); }, &recording);
  return recording;
}

}  // namespace twofold
