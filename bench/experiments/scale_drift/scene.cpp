#include "experiments/scale_drift/scene.hpp"

#include <array>
#include <cmath>
#include <random>

namespace twofold::bench {
namespace {

constexpr double kPi = 3.14159265358979323846;

/// The camera of the program with which the thesis' author published these two experiments (RobotVision 1.0,
/// rss2010_demo): a wide, coarse one, as in section 3.5.
Rig mono_rig() {
  Rig rig;
  rig.kind = SensorKind::kMono;
  rig.camera = {195, 195, 162, 125, 320, 240};
  return rig;
}

/// World-to-camera pose of a camera at `centre_w` that looks along `forward_w`, its image's x axis as near to
/// `right_w` as can be.
SE3 look_along(const Vector3& centre_w, const Vector3& forward_w, const Vector3& right_w) {
  Matrix3 R_w_c;
  R_w_c.col(2) = forward_w.normalized();
  R_w_c.col(1) = R_w_c.col(2).cross(right_w).normalized();
  R_w_c.col(0) = R_w_c.col(1).cross(R_w_c.col(2));
  return SE3(R_w_c, centre_w).inverse();
}

/// A closed way from longitude 0 on the equator: `turns` around the axis, the latitude atan(climb *
/// longitude) for the first half of it and back the same way for the second.
struct Excursion {
  int turns;
  double climb;  ///< negative: southwards
};
constexpr std::array<Excursion, 4> kExcursions = {{{2, 0.1}, {2, -0.1}, {1, 0.5}, {1, -0.5}}};

/// Poses `step` apart, looking down, the long side of the image across the flight.
void fly(const Excursion& excursion, double radius, double step, std::vector<SE3>& T_c_w) {
  const double end = 2 * kPi * excursion.turns;
  const auto up_at = [&](double longitude) {
    const double latitude = std::atan(excursion.climb * std::min(longitude, end - longitude));
    return Vector3(std::cos(latitude) * std::cos(longitude), std::cos(latitude) * std::sin(longitude),
                   std::sin(latitude));
  };
  constexpr double kFine = 1e-4;  // of longitude
  Vector3 last = T_c_w.empty() ? Vector3::Zero().eval() : T_c_w.back().inverse().translation();
  for (double longitude = 0; longitude < end; longitude += kFine) {
    const Vector3 up = up_at(longitude);
    if ((radius * up - last).norm() < step) continue;
    T_c_w.push_back(look_along(radius * up, -up, up.cross(up_at(longitude + kFine) - up)));
    last = radius * up;
  }
}

}  // namespace

Scene circle_scene(double radius, unsigned seed) {
  std::mt19937 rng(seed);
  std::uniform_real_distribution<double> angle(-kPi, kPi), height(-1, 1);
  Scene scene;
  scene.rig = mono_rig();
  scene.max_depth = 3;
  const int poses = static_cast<int>(std::lround(72 * radius));
  for (int i = 0; i < poses; ++i) {
    const double a = 2 * kPi * i / poses;
    const Vector3 outwards(std::cos(a), std::sin(a), 0), along(-std::sin(a), std::cos(a), 0);
    scene.T_c_w.push_back(look_along(radius * outwards, outwards, along));
  }
  const int points = static_cast<int>(std::lround(500 * radius));
  for (int j = 0; j < points; ++j) {
    const double a = angle(rng), r = radius + 1;
    scene.points.emplace_back(r * std::cos(a), r * std::sin(a), height(rng));
  }
  return scene;
}

Scene sphere_scene(const SphereOptions& options, unsigned seed) {
  std::mt19937 rng(seed);
  std::uniform_real_distribution<double> unit(0, 1);
  Scene scene;
  scene.rig = mono_rig();
  scene.rig.camera.width = 324;  // that program's image here: twice the principal point
  scene.rig.camera.height = 250;
  scene.max_depth = 2 * options.height;
  const double flight = options.radius + options.height;
  for (const Excursion& excursion : kExcursions) {
    fly(excursion, flight, options.step, scene.T_c_w);
  }
  const double area = 4 * kPi * options.radius * options.radius;
  const int points = static_cast<int>(std::lround(options.density * area));
  for (int j = 0; j < points; ++j) {
    const double longitude = 2 * kPi * unit(rng), from_pole = std::sqrt(kPi * unit(rng));
    const double z = std::cos(from_pole) * (unit(rng) < 0.5 ? 1 : -1);
    scene.points.emplace_back(options.radius * std::sin(from_pole) * std::cos(longitude),
                              options.radius * std::sin(from_pole) * std::sin(longitude), options.radius * z);
  }
  return scene;
}

std::vector<std::vector<Sighting>> measure(const Scene& scene, double sigma_px, unsigned seed) {
  std::mt19937 rng(seed);
  std::normal_distribution<double> noise(0, 1);
  std::vector<std::vector<Sighting>> frames;
  for (const SE3& T_c_w : scene.T_c_w) {
    frames.emplace_back();
    for (std::size_t j = 0; j < scene.points.size(); ++j) {
      const Vector3 x_c = T_c_w * scene.points[j];
      if (x_c.z() < 0.2 || x_c.z() > scene.max_depth) continue;
      const Vector2 uv = scene.rig.camera.project(x_c);
      if (!scene.rig.camera.contains(uv)) continue;
      const Vector2 error(noise(rng), noise(rng));
      frames.back().push_back({static_cast<int>(j), uv + sigma_px * error});
    }
  }
  return frames;
}

}  // namespace twofold::bench
