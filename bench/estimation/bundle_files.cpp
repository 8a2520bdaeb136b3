#include "bench/estimation/bundle_files.hpp"

#include <fstream>
#include <map>
#include <stdexcept>

#include "bench/estimation/bundle.hpp"
#include "estimation/observation_model.hpp"
#include "geometry/inverse_depth.hpp"

namespace twofold {
namespace {

std::ifstream open(const std::filesystem::path& path) {
  std::ifstream in(path);
  if (!in) throw std::runtime_error(path.string() + ": cannot be opened");
  return in;
}

/// Poses by key, as T_c_w (the file has T_w_c).
std::map<int, SE3> read_stereo_poses(const std::filesystem::path& path) {
  std::ifstream in = open(path);
  FieldReader reader(in, path.string());
  std::map<int, SE3> poses;
  while (!reader.at_end()) {
    reader.next(17, "pose");
    const int key = reader.number<int>();
    Matrix4 T;
    for (int n = 0; n < 16; ++n) T(n / 4, n % 4) = reader.number<double>();
    const Matrix3 R = T.topLeftCorner<3, 3>();
    if (!((R * R.transpose() - Matrix3::Identity()).norm() < 1e-3)) reader.fail("not a rotation");
    poses[key] = SE3(R, Vector3(T.topRightCorner<3, 1>())).inverse();
  }
  return poses;
}

WindowProblem read_stereo_folder(const std::filesystem::path& folder) {
  Bundle bundle;
  {
    const auto path = folder / "VO_calibration.txt";
    std::ifstream in = open(path);
    FieldReader reader(in, path.string());
    reader.next(6, "calibration");
    double v[6];  // fx fy skew cx cy baseline
    for (double& value : v) value = reader.number<double>();
    if (v[2] != 0) reader.fail("skew is not supported");
    if (!(v[0] > 0) || !(v[1] > 0) || !(v[5] > 0)) reader.fail("focal lengths and baseline must be positive");
    bundle.rig.camera = {v[0], v[1], v[3], v[4], 0, 0};
    bundle.rig.baseline = v[5];
  }
  std::map<int, int> camera_index, point_index;
  for (const auto& [key, T] : read_stereo_poses(folder / "VO_camera_poses_large.txt")) {
    camera_index[key] = static_cast<int>(bundle.cameras.size());
    bundle.cameras.push_back(T);
  }
  const auto path = folder / "VO_stereo_factors_large.txt";
  std::ifstream in = open(path);
  FieldReader reader(in, path.string());
  while (!reader.at_end()) {
    reader.next(8, "stereo measurement");
    const int camera_key = reader.number<int>(), point_key = reader.number<int>();
    const auto camera = camera_index.find(camera_key);
    if (camera == camera_index.end()) reader.fail("no pose " + std::to_string(camera_key));
    const Vector3 uL_uR_v = read_vector(reader), x_c = read_vector(reader);
    const auto [point, is_new] = point_index.emplace(point_key, static_cast<int>(bundle.points.size()));
    if (is_new) {
      bundle.points.push_back(bundle.cameras[camera->second].inverse() * x_c);
      bundle.observations.emplace_back();
    }
    bundle.observations[point->second].push_back(
        {camera->second, Vector3(uL_uR_v[0], uL_uR_v[2], uL_uR_v[1]).cast<float>(), {1, 1, 1}});
  }
  return to_window(bundle);
}

/// The two text layouts differ in their second line: an observation has four fields, libmv's camera line
/// nine.
bool is_libmv(const std::filesystem::path& path) {
  std::ifstream in = open(path);
  std::string line, first;
  for (int n = 0; n < 2 && std::getline(in, line);) {
    if (line.find_first_not_of(" \t\r") != std::string::npos) ++n;
  }
  return line.starts_with("P ") || line.starts_with("N ");
}

}  // namespace

WindowProblem to_window(const Bundle& bundle) {
  WindowProblem problem;
  problem.rig = bundle.rig;
  for (const SE3& T : bundle.cameras) problem.poses.push_back({T, false});
  for (std::size_t k = 0; k < bundle.points.size(); ++k) {
    WindowProblem::Point point;
    point.first_observation = static_cast<int>(problem.observations.size());
    for (const auto& o : bundle.observations[k]) {
      const Vector3 x = bundle.cameras[o.pose] * bundle.points[k];
      if (!(x.z() > 2 * kMinDepth)) continue;
      if (point.observation_count++ == 0) {
        point.anchor = o.pose;
        point.psi = to_inverse_depth(x);
      }
      problem.observations.push_back(o);
    }
    if (point.observation_count < 2) {
      problem.observations.resize(point.first_observation);
    } else {
      problem.points.push_back(point);
    }
  }
  return problem;
}

Vector3 read_vector(FieldReader& reader) {
  Vector3 v;
  for (double& value : v) value = reader.number<double>();
  if (!v.allFinite()) reader.fail("number is not finite");
  return v;
}

WindowProblem read_bundle(const std::filesystem::path& path) {
  WindowProblem problem;
  if (std::filesystem::is_directory(path)) {
    problem = read_stereo_folder(path);
  } else {
    std::ifstream in = open(path);
    FieldReader reader(in, path.string());
    reader.next(3, "header (cameras points observations)");
    const int cameras = reader.count(), points = reader.count(), observations = reader.count();
    problem = is_libmv(path) ? read_libmv(reader, cameras, points, observations)
                             : read_bal(reader, cameras, points, observations);
    if (!reader.at_end()) {
      reader.next(0, "end of the file");
    }
  }
  if (problem.points.empty()) throw std::runtime_error(path.string() + ": no point is seen twice");
  return problem;
}

}  // namespace twofold
