#include "io/files/calibration_file.hpp"

#include <array>
#include <map>

#include <fmt/format.h>

#include "camera/opencv_distortion.hpp"
#include "io/files/io_error.hpp"
#include "io/files/kitti_calibration.hpp"
#include "io/files/openloris_files.hpp"
#include "io/files/text_file.hpp"
#include "io/files/yaml_node.hpp"

namespace twofold {
namespace {

namespace fs = std::filesystem;

Distortion opencv_distortion_of(const YamlNode& coefficients) {
  const auto distortion = opencv_distortion(coefficients.numbers());
  if (!distortion) coefficients.fail(distortion.error());
  return *distortion;
}

Distortion equidistant_of(const YamlNode& coefficients) {
  const auto distortion = equidistant_distortion(coefficients.numbers());
  if (!distortion) coefficients.fail(distortion.error());
  return *distortion;
}

/// @param coefficients  null where there are none
Distortion distortion_of(const YamlNode& model, const YamlNode* coefficients) {
  static const std::map<std::string, DistortionModel> kNames{
      {"none", DistortionModel::kNone},
      {"radtan", DistortionModel::kRadTan},
      {"radial-tangential", DistortionModel::kRadTan},
      {"plumb_bob", DistortionModel::kRadTan},
      {"rational", DistortionModel::kRational},
      {"rational_polynomial", DistortionModel::kRational},
      {"equidistant", DistortionModel::kEquidistant},
      {"fisheye", DistortionModel::kEquidistant}};
  const auto name = kNames.find(model.text());
  if (name == kNames.end())
    model.fail(fmt::format("is '{}', not none, radtan, rational or equidistant", model.text()));
  if (name->second == DistortionModel::kNone) return {};
  if (!coefficients) model.fail(fmt::format("is '{}', but there are no coefficients", model.text()));
  if (name->second == DistortionModel::kEquidistant) return equidistant_of(*coefficients);
  const std::size_t count = coefficients->items().size();
  if (name->second == DistortionModel::kRational && count < 8)
    coefficients->fail(fmt::format("has {} coefficients, rational has 8", count));
  return opencv_distortion_of(*coefficients);
}

void read_size(const YamlNode& node, PinholeCamera* camera) {
  const auto items = node.items();
  if (items.size() != 2) node.fail("is not [width, height]");
  camera->width = items[0].integer();
  camera->height = items[1].integer();
}

void read_intrinsics(const YamlNode& node, PinholeCamera* camera) {
  const auto v = node.numbers(4);
  camera->fx = v[0];
  camera->fy = v[1];
  camera->cx = v[2];
  camera->cy = v[3];
}

/// EuRoC and Kalibr agree but for the names of two keys.
CameraModel read_camera(const YamlNode& node, const char* coefficients_key) {
  CameraModel camera;
  read_size(node.at("resolution"), &camera.pinhole);
  const YamlNode model = node.at("camera_model");
  if (model.text() == "ds") {  // Kalibr: xi, alpha, then the pinhole's
    const auto v = node.at("intrinsics").numbers(6);
    camera.distortion.model = DistortionModel::kDoubleSphere;
    camera.distortion.coefficients = {v[0], v[1]};
    camera.pinhole = {v[2], v[3], v[4], v[5], camera.pinhole.width, camera.pinhole.height};
    return camera;
  }
  if (model.text() != "pinhole") model.fail(fmt::format("is '{}', not pinhole or ds", model.text()));
  read_intrinsics(node.at("intrinsics"), &camera.pinhole);
  if (!node.has("distortion_model")) return camera;
  if (!node.has(coefficients_key)) {
    camera.distortion = distortion_of(node.at("distortion_model"), nullptr);
  } else {
    const YamlNode coefficients = node.at(coefficients_key);
    camera.distortion = distortion_of(node.at("distortion_model"), &coefficients);
  }
  return camera;
}

Calibration read_kalibr(const YamlNode& root) {
  Calibration calibration;
  calibration.left = read_camera(root.at("cam0"), "distortion_coeffs");
  calibration.kind = SensorKind::kMono;
  if (root.has("cam1")) {
    calibration.kind = SensorKind::kStereo;
    calibration.right = read_camera(root.at("cam1"), "distortion_coeffs");
    calibration.T_right_left = root.at("cam1").at("T_cn_cnm1").rigid_motion();
  }
  return calibration;
}

/// ROS names the model; OpenCV says only whether it is a fisheye.
Distortion read_opencv_lens(const YamlNode& root) {
  if (!root.has("distortion_coefficients")) return {};
  const YamlNode coefficients = root.at("distortion_coefficients").at("data");
  if (root.has("distortion_model")) return distortion_of(root.at("distortion_model"), &coefficients);
  const bool fisheye = root.has("fisheye_model") && root.at("fisheye_model").integer() != 0;
  return fisheye ? equidistant_of(coefficients) : opencv_distortion_of(coefficients);
}

/// As OpenCV's calibration program writes it, and ROS' keeps camera_info.
Calibration read_opencv(const YamlNode& root) {
  Calibration calibration;
  calibration.kind = SensorKind::kMono;
  const YamlNode matrix = root.at("camera_matrix");
  const auto K = matrix.at("data").numbers(9);
  if (K[1] != 0 || K[3] != 0 || K[6] != 0 || K[7] != 0 || K[8] != 1)
    matrix.fail("is not [fx, 0, cx, 0, fy, cy, 0, 0, 1]");
  calibration.left.pinhole = {
      K[0], K[4], K[2], K[5], root.at("image_width").integer(), root.at("image_height").integer()};
  calibration.left.distortion = read_opencv_lens(root);
  return calibration;
}

Distortion read_own_distortion(const YamlNode& node) {
  node.expect_keys({"model", "coefficients"});
  if (!node.has("coefficients")) return distortion_of(node.at("model"), nullptr);
  const YamlNode coefficients = node.at("coefficients");
  return distortion_of(node.at("model"), &coefficients);
}

CameraModel read_own_camera(const YamlNode& node) {
  node.expect_keys({"size", "intrinsics", "distortion"});
  CameraModel camera;
  read_size(node.at("size"), &camera.pinhole);
  read_intrinsics(node.at("intrinsics"), &camera.pinhole);
  if (node.has("distortion")) camera.distortion = read_own_distortion(node.at("distortion"));
  return camera;
}

void read_own_stereo(const YamlNode& root, const std::vector<YamlNode>& cameras, Calibration* calibration) {
  if (root.has("baseline")) {
    if (cameras.size() != 1)
      root.at("baseline").fail("goes with one entry in 'cameras'; else give T_right_left");
    const double baseline = root.at("baseline").number();
    if (baseline <= 0) root.at("baseline").fail(fmt::format("is {}, must be positive", baseline));
    calibration->right = calibration->left;
    calibration->T_right_left = SE3(SO3(), Vector3(-baseline, 0, 0));
    calibration->already_rectified = calibration->left.distortion.is_identity();
    return;
  }
  if (cameras.size() != 2)
    root.at("cameras").fail("needs two entries for stereo, or one and the key 'baseline'");
  calibration->right = read_own_camera(cameras[1]);
  calibration->T_right_left = root.at("T_right_left").rigid_motion();
}

/// Of depth images that are not the colour camera's; keys of the `depth` section.
DepthCamera read_own_depth_camera(const YamlNode& node) {
  DepthCamera camera;
  read_size(node.at("size"), &camera.model.pinhole);
  read_intrinsics(node.at("intrinsics"), &camera.model.pinhole);
  if (node.has("distortion")) camera.model.distortion = read_own_distortion(node.at("distortion"));
  camera.T_left_depth = node.at("T_left_depth").rigid_motion();
  return camera;
}

void read_own_depth(const YamlNode& node, Calibration* calibration) {
  node.expect_keys(
      {"unit", "min", "max", "virtual_baseline", "size", "intrinsics", "distortion", "T_left_depth"});
  calibration->depth_unit_stated = node.has("unit");
  if (calibration->depth_unit_stated) calibration->depth_unit = node.at("unit").number();
  if (node.has("min")) calibration->depth_min = node.at("min").number();
  if (node.has("max")) calibration->depth_max = node.at("max").number();
  if (node.has("virtual_baseline")) calibration->virtual_baseline = node.at("virtual_baseline").number();
  for (const char* key : {"size", "intrinsics", "distortion", "T_left_depth"})
    calibration->depth_apart |= node.has(key);
  if (calibration->depth_apart) calibration->depth_camera = read_own_depth_camera(node);
}

Calibration read_own(const YamlNode& root) {
  root.expect_keys({"sensor", "fps", "readout", "cameras", "baseline", "T_right_left", "depth", "quality"});
  static const std::map<std::string, SensorKind> kKinds{
      {"mono", SensorKind::kMono}, {"stereo", SensorKind::kStereo}, {"rgbd", SensorKind::kRgbd}};
  const YamlNode sensor = root.at("sensor");
  const auto kind = kKinds.find(sensor.text());
  if (kind == kKinds.end()) sensor.fail(fmt::format("is '{}', not mono, stereo or rgbd", sensor.text()));
  Calibration calibration;
  calibration.kind = kind->second;
  if (root.has("fps")) calibration.fps = root.at("fps").number();
  if (root.has("readout")) calibration.readout = root.at("readout").number();
  const auto cameras = root.at("cameras").items();
  if (cameras.empty()) root.at("cameras").fail("is empty");
  calibration.left = read_own_camera(cameras[0]);
  if (calibration.kind == SensorKind::kStereo) {
    read_own_stereo(root, cameras, &calibration);
  } else if (cameras.size() != 1) {
    root.at("cameras").fail("has more than one entry, but the sensor is not stereo");
  }
  if (root.has("depth")) read_own_depth(root.at("depth"), &calibration);
  return calibration;
}

}  // namespace

const char* distortion_name(DistortionModel model) {
  switch (model) {
    case DistortionModel::kNone:
      break;
    case DistortionModel::kRadTan:
      return "radtan";
    case DistortionModel::kEquidistant:
      return "equidistant";
    case DistortionModel::kDoubleSphere:
      return "ds";
    case DistortionModel::kRational:
      return "rational";
  }
  return "none";
}

EurocCamera read_euroc_camera(const fs::path& file) {
  const YamlNode root = YamlNode::load(file);
  EurocCamera camera;
  camera.model = read_camera(root, "distortion_coefficients");
  if (root.has("T_BS")) camera.T_b_c = root.at("T_BS").rigid_motion();
  if (root.has("rate_hz")) camera.rate_hz = root.at("rate_hz").number();
  if (root.has("readout")) camera.readout = root.at("readout").number();
  return camera;
}

SE3 read_euroc_sensor_pose(const fs::path& file) {
  return YamlNode::load(file).at("T_BS").rigid_motion();
}

std::optional<SE3> read_camera_in_body(const fs::path& file) {
  std::error_code ignored;
  if (fs::is_directory(file, ignored)) return read_camera_in_body(euroc_sensor_file(file, "cam0"));
  if (looks_like_kitti_calibration(file)) return std::nullopt;
  const YamlNode root = YamlNode::load(file);
  if (root.has("T_BS")) return root.at("T_BS").rigid_motion();
  if (!root.has("cam0") || !root.at("cam0").has("T_cam_imu")) return std::nullopt;
  return root.at("cam0").at("T_cam_imu").rigid_motion().inverse();
}

Calibration read_euroc_calibration(const fs::path& cam0, const fs::path& cam1) {
  const EurocCamera left = read_euroc_camera(cam0);
  const EurocCamera right = read_euroc_camera(cam1);
  Calibration calibration;
  calibration.left = left.model;
  calibration.right = right.model;
  calibration.T_right_left = read_euroc_sensor_pose(cam1).inverse() * read_euroc_sensor_pose(cam0);
  calibration.fps = left.rate_hz;
  calibration.readout = left.readout;
  calibration.already_rectified = true;
  if (!calibration.invalid_reason().empty()) calibration.already_rectified = false;
  return calibration;
}

fs::path euroc_sensor_file(const fs::path& folder, const std::string& sensor) {
  const fs::path inside = folder / "mav0";
  std::error_code ignored;
  return (fs::is_directory(inside, ignored) ? inside : folder) / sensor / "sensor.yaml";
}

std::optional<Calibration> read_plain_intrinsics(const fs::path& file) {
  const auto lines = read_text_lines(file);
  if (lines.size() != 1) return std::nullopt;
  const auto fields = split_fields(lines[0].text);
  if (fields.size() != 4) return std::nullopt;
  std::array<double, 4> values{};
  for (std::size_t i = 0; i < values.size(); ++i) {
    const auto value = to_number(fields[i]);
    if (!value) return std::nullopt;
    values[i] = *value;
  }
  Calibration calibration;
  calibration.kind = SensorKind::kMono;
  calibration.left.pinhole = {values[0], values[1], values[2], values[3], 0, 0};
  return calibration;
}

Calibration read_calibration(const fs::path& file) {
  std::error_code ignored;
  if (fs::is_directory(file, ignored)) {
    const fs::path cam0 = euroc_sensor_file(file, "cam0"), cam1 = euroc_sensor_file(file, "cam1");
    if (!fs::exists(cam0, ignored))
      throw IoError(file, "is a folder without cam0/sensor.yaml (EuRoC's): give a calibration file");
    return fs::exists(cam1, ignored) ? read_euroc_calibration(cam0, cam1) : read_calibration(cam0);
  }
  if (!fs::is_regular_file(file, ignored)) throw IoError(file, "no such calibration file");
  if (looks_like_kitti_calibration(file)) return read_kitti_calibration(file);
  if (const auto plain = read_plain_intrinsics(file)) return *plain;
  const YamlNode root = YamlNode::load(file);
  if (root.has("cameras")) return read_own(root);
  if (root.has("cam0")) return read_kalibr(root);
  if (root.has("camera_matrix")) return read_opencv(root);
  if (root.has(kOpenLorisColour)) return read_openloris_sensors(root);
  if (root.has("camera_model") || root.has("T_BS")) {
    const EurocCamera camera = read_euroc_camera(file);
    Calibration calibration;
    calibration.kind = SensorKind::kMono;
    calibration.left = camera.model;
    calibration.fps = camera.rate_hz;
    calibration.readout = camera.readout;
    return calibration;
  }
  throw IoError(
      file,
      "has none of the keys 'cameras', 'cam0', 'camera_model', 'camera_matrix' or 'P0:': not a calibration");
}

void set_missing_size(const fs::path& file, int width, int height, Calibration* calibration) {
  for (PinholeCamera* camera : {&calibration->left.pinhole, &calibration->right.pinhole}) {
    if (camera->width != 0 || camera->height != 0) continue;
    camera->width = width;
    camera->height = height;
    if (!camera->contains({camera->cx, camera->cy}))
      throw IoError(file,
                    fmt::format("the camera's centre, cx = {:.6g} and cy = {:.6g}, is not in the images, "
                                "which are {}x{}: the numbers are of others (in a calibration file "
                                "that says its size any centre near the image will do)",
                                camera->cx, camera->cy, width, height));
  }
}

void expect_valid(const fs::path& file, const Calibration& calibration) {
  if (const auto reason = calibration.invalid_reason(); !reason.empty()) throw IoError(file, reason);
}

}  // namespace twofold
