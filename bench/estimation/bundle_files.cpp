#include "bench/estimation/bundle_files.hpp"

#include <cmath>
#include <fstream>
#include <map>
#include <opencv2/calib3d.hpp>
#include <stdexcept>

#include "estimation/field_reader.hpp"
#include "estimation/observation_model.hpp"
#include "geometry/inverse_depth.hpp"

namespace twofold {
namespace {

struct Bundle {
  Rig rig;
  std::vector<SE3> cameras;
  std::vector<Vector3> points;
  std::vector<std::vector<WindowProblem::Observation>> observations;  // by point
};

std::ifstream open(const std::filesystem::path& path) {
  std::ifstream in(path);
  if (!in) throw std::runtime_error(path.string() + ": cannot be opened");
  return in;
}

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

int index_below(FieldReader& reader, int limit, const char* what) {
  const int index = reader.number<int>();
  if (index < 0 || index >= limit) {
    reader.fail(std::string("no ").append(what).append(" ").append(std::to_string(index)));
  }
  return index;
}

Vector3 read_vector(FieldReader& reader) {
  Vector3 v;
  for (double& value : v) value = reader.number<double>();
  if (!v.allFinite()) reader.fail("number is not finite");
  return v;
}

/// Observations as the file has them, to be freed from distortion when the cameras are known.
struct RawObservation {
  int camera, point;
  Vector2 z;
};

std::vector<RawObservation> read_observations(FieldReader& reader, int cameras, int points, int count) {
  std::vector<RawObservation> observations;
  for (int n = 0; n < count; ++n) {
    reader.next(4, "observation");
    RawObservation o;
    o.camera = index_below(reader, cameras, "camera");
    o.point = index_below(reader, points, "point");
    o.z.x() = reader.number<double>();
    o.z.y() = reader.number<double>();
    if (!o.z.allFinite()) reader.fail("measurement is not finite");
    observations.push_back(o);
  }
  return observations;
}

double read_line(FieldReader& reader, const char* what) {
  reader.next(1, what);
  return reader.number<double>();
}

/// Inverse of r (1 + k1 r^2 + k2 r^4) by Newton's method.
double undistorted_radius(double r_distorted, double k1, double k2) {
  double r = r_distorted;
  for (int n = 0; n < 20; ++n) {
    const double r2 = r * r;
    const double slope = 1 + r2 * (3 * k1 + 5 * k2 * r2);
    if (!(slope > 0.1)) break;  // next to a fold of the model; stays at the last radius before it
    r -= (r * (1 + r2 * (k1 + k2 * r2)) - r_distorted) / slope;
  }
  return r;
}

WindowProblem read_bal(FieldReader& reader, int cameras, int points, int count) {
  const auto raw = read_observations(reader, cameras, points, count);
  Bundle bundle;
  std::vector<Vector3> lenses;  // f, k1, k2
  const SE3 T_flip(Eigen::Quaterniond(0, 1, 0, 0).toRotationMatrix(),
                   Vector3::Zero());  // -z to +z, y with it
  for (int i = 0; i < cameras; ++i) {
    double value[9];
    for (double& v : value) v = read_line(reader, "camera parameter");
    const Eigen::Map<const Vector3> w(value), t(value + 3);
    lenses.emplace_back(value[6], value[7], value[8]);
    if (!w.allFinite() || !t.allFinite() || !lenses.back().allFinite()) reader.fail("number is not finite");
    if (!(value[6] > 0)) reader.fail("focal length must be positive");
    bundle.cameras.push_back(T_flip * SE3(SO3::exp(w), t));
  }
  for (int k = 0; k < points; ++k) {
    Vector3 p;
    for (double& v : p) v = read_line(reader, "point coordinate");
    if (!p.allFinite()) reader.fail("number is not finite");
    bundle.points.push_back(p);
  }
  const double f = lenses.empty() ? 1 : lenses.front()[0];
  bundle.rig.kind = SensorKind::kMono;
  bundle.rig.camera = {f, f, 0, 0, 0, 0};
  bundle.observations.resize(points);
  for (const auto& o : raw) {
    const Vector3& lens = lenses[o.camera];
    Vector2 xy = o.z / lens[0];
    const double r = xy.norm();
    if (r > 0) xy *= undistorted_radius(r, lens[1], lens[2]) / r;
    const auto weight = static_cast<float>(lens[0] * lens[0] / (f * f));
    // y points down here and up there.
    bundle.observations[o.point].push_back(
        {o.camera, Vector3(f * xy.x(), -f * xy.y(), 0).cast<float>(), {weight, weight, 0}});
  }
  return to_window(bundle);
}

WindowProblem read_libmv(FieldReader& reader, int cameras, int points, int count) {
  reader.next(9, "camera line");
  const std::string_view space = reader.word();
  if (space != "P" && space != "N") reader.fail("marker space must be P or N");
  const bool normalised = space == "N";
  double v[8];  // f cx cy k1 k2 k3 p1 p2
  for (double& value : v) value = reader.number<double>();
  if (!(v[0] > 0)) reader.fail("focal length must be positive");
  const auto raw = read_observations(reader, cameras, points, count);
  Bundle bundle;
  bundle.rig.kind = SensorKind::kMono;
  bundle.rig.camera = {v[0], v[0], v[1], v[2], 0, 0};
  for (int i = 0; i < cameras; ++i) {
    reader.next(6, "camera");
    const Vector3 w = read_vector(reader);
    bundle.cameras.emplace_back(SO3::exp(w), read_vector(reader));
  }
  for (int k = 0; k < points; ++k) {
    reader.next(3, "point");
    bundle.points.push_back(read_vector(reader));
  }
  const cv::Matx33d K(v[0], 0, v[1], 0, v[0], v[2], 0, 0, 1);
  const cv::Vec<double, 5> distortion(v[3], v[4], v[6], v[7], v[5]);  // OpenCV: k1 k2 p1 p2 k3
  bundle.observations.resize(points);
  for (const auto& o : raw) {
    Vector2 uv = o.z;
    if (normalised) {
      uv = v[0] * uv + Vector2(v[1], v[2]);
    } else {
      const std::vector<cv::Point2d> distorted{{uv.x(), uv.y()}};
      std::vector<cv::Point2d> ideal;
      cv::undistortPoints(distorted, ideal, K, distortion, cv::noArray(), K,
                          cv::TermCriteria(cv::TermCriteria::COUNT | cv::TermCriteria::EPS, 50, 1e-12));
      uv = Vector2(ideal[0].x, ideal[0].y);
    }
    bundle.observations[o.point].push_back({o.camera, Vector3(uv.x(), uv.y(), 0).cast<float>(), {1, 1, 0}});
  }
  return to_window(bundle);
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
