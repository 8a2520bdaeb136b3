#pragma once

#include <random>
#include <vector>

#include "camera/rig.hpp"
#include "filters/gauss_newton_filter.hpp"

namespace twofold::testing {

inline Rig make_rig(SensorKind kind) {
  Rig rig;
  rig.kind = kind;
  rig.camera = {500, 500, 319.5, 239.5, 640, 480};
  rig.baseline = 0.1;
  return rig;
}

struct Scene {
  std::vector<SE3> T_c_w;
  std::vector<Vector3> points;
  std::vector<std::vector<PointObservation>> observations;
};

inline Scene make_scene(const Rig& rig, int frames, int count, double noise, unsigned seed) {
  std::mt19937 rng(seed);
  std::normal_distribution<double> normal(0, 1);
  std::uniform_real_distribution<double> x(-0.8, 1.2), y(-0.9, 0.9), z(1.8, 2.6);
  Scene scene;
  for (int i = 0; i < count; ++i) scene.points.emplace_back(x(rng), y(rng), z(rng));
  for (int j = 0; j < frames; ++j) {
    const SE3 T_w_c(SO3::exp(Vector3(0.01 * j, -0.02 * j, 0.01 * j)), Vector3(0.12 * j, 0.01 * j, 0.02 * j));
    scene.T_c_w.push_back(T_w_c.inverse());
    std::vector<PointObservation> seen;
    for (int i = 0; i < count; ++i) {
      const Vector3 z_true = rig.project(scene.T_c_w.back() * scene.points[static_cast<std::size_t>(i)]);
      seen.push_back({i, z_true + noise * Vector3(normal(rng), normal(rng), normal(rng))});
    }
    scene.observations.push_back(seen);
  }
  return scene;
}

}  // namespace twofold::testing
