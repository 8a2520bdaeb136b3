// The two text layouts of bundle_files.hpp.
#include <cmath>
#include <opencv2/calib3d.hpp>

#include "bench/estimation/bundle.hpp"

namespace twofold {
namespace {

int index_below(FieldReader& reader, int limit, const char* what) {
  const int index = reader.number<int>();
  if (index < 0 || index >= limit) {
    reader.fail(std::string("no ").append(what).append(" ").append(std::to_string(index)));
  }
  return index;
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

}  // namespace

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

}  // namespace twofold
