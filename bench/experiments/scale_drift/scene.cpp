#include "experiments/scale_drift/scene.hpp"

#include <cmath>
#include <random>
#include <stdexcept>

namespace twofold::bench {
namespace {

constexpr double kPi = 3.14159265358979323846;

Rig mono_rig() {
  Rig rig;
  rig.kind = SensorKind::kMono;
  rig.camera = {500, 500, 319.5, 239.5, 640, 480};
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

}  // namespace

Scene circle_scene(double radius, unsigned seed) {
  std::mt19937 rng(seed);
  std::uniform_real_distribution<double> angle(-kPi, kPi), relief(-0.4, 0.4);
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
    const double a = angle(rng), r = radius + 1 + relief(rng);
    scene.points.emplace_back(r * std::cos(a), r * std::sin(a), relief(rng));
  }
  return scene;
}

Scene sphere_scene(const SphereOptions& options, unsigned seed) {
  std::mt19937 rng(seed);
  std::normal_distribution<double> normal(0, 1);
  std::uniform_real_distribution<double> relief(-options.relief, options.relief);
  Scene scene;
  scene.rig = mono_rig();
  scene.max_depth = 2 * options.height;
  const double flight = options.radius + options.height;
  const double arc = options.turns * options.spacing / flight;  // of latitude
  if (arc > 0.9 * kPi) throw std::runtime_error("the sphere is too small for so many turns");
  for (double longitude = 0; longitude < 2 * kPi * options.turns;) {
    const double latitude = arc * (0.5 - longitude / (2 * kPi * options.turns));
    const double c = std::cos(latitude), s = std::sin(latitude);
    const Vector3 up(c * std::cos(longitude), c * std::sin(longitude), s);
    const Vector3 across(-s * std::cos(longitude), -s * std::sin(longitude), c);
    scene.T_c_w.push_back(look_along(flight * up, -up, across));
    longitude += options.step / (flight * c);
  }
  const double area = 4 * kPi * options.radius * options.radius;
  const int points = static_cast<int>(std::lround(options.density * area));
  for (int j = 0; j < points; ++j) {
    const Vector3 up = Vector3(normal(rng), normal(rng), normal(rng)).normalized();
    scene.points.push_back((options.radius + relief(rng)) * up);
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
