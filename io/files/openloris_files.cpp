#include "io/files/openloris_files.hpp"

#include <algorithm>
#include <map>
#include <string>
#include <vector>

#include <fmt/format.h>

#include "camera/opencv_distortion.hpp"
#include "io/files/io_error.hpp"

namespace twofold {
namespace {

namespace fs = std::filesystem;

/// The colour camera's coefficients are all zero; a model is named for the fisheye cameras' only.
Distortion read_openloris_lens(const YamlNode& sensor) {
  if (!sensor.has("distortion_coefficients")) return {};
  const YamlNode node = sensor.at("distortion_coefficients").at("data");
  const std::vector<double> coefficients = node.numbers();
  if (std::all_of(coefficients.begin(), coefficients.end(), [](double k) { return k == 0; })) return {};
  const bool fisheye =
      sensor.has("distortion_model") && sensor.at("distortion_model").text() == "Kannala-Brandt";
  const auto distortion = fisheye ? equidistant_distortion(coefficients) : opencv_distortion(coefficients);
  if (!distortion) node.fail(distortion.error());
  return *distortion;
}

/// A sensor's pose in another one.
struct Mount {
  std::string parent;
  SE3 T_parent_child;
};

}  // namespace

Calibration read_openloris_sensors(const YamlNode& root) {
  const YamlNode sensor = root.at(kOpenLorisColour);
  const auto K = sensor.at("intrinsics").at("data").numbers(4);
  Calibration calibration;
  calibration.kind = SensorKind::kMono;
  calibration.left.pinhole = {
      K[0], K[2], K[1], K[3], sensor.at("width").integer(), sensor.at("height").integer()};
  calibration.left.distortion = read_openloris_lens(sensor);
  if (sensor.has("fps")) calibration.fps = sensor.at("fps").number();
  return calibration;
}

SE3 read_openloris_camera_in_base(const fs::path& file) {
  std::map<std::string, Mount> mounts;  // by the child's name
  for (const YamlNode& item : YamlNode::load(file).at("trans_matrix").items())
    mounts[item.at("child_frame").text()] = {item.at("parent_frame").text(),
                                             item.at("matrix").rigid_motion()};
  std::string frame = kOpenLorisColour;
  SE3 T_frame_camera;
  // A chain is no longer than the list; one that is goes round in a circle.
  for (std::size_t step = 0; step < mounts.size() && frame != "base_link"; ++step) {
    const auto mount = mounts.find(frame);
    if (mount == mounts.end()) break;
    T_frame_camera = mount->second.T_parent_child * T_frame_camera;
    frame = mount->second.parent;
  }
  if (frame != "base_link")
    throw IoError(file, fmt::format("does not say how {} sits in base_link", kOpenLorisColour));
  return T_frame_camera;
}

}  // namespace twofold
