#include "experiments/double_window/scene.hpp"

#include <algorithm>
#include <cmath>
#include <map>
#include <numbers>
#include <random>

#include "fixtures/simulation.hpp"

namespace twofold::bench {
namespace {

constexpr double kViewRadius = 3;  // points farther away on the ground are not looked at [m]
constexpr double kBorderPx = 4;

using Cell = std::pair<int, int>;

Cell cell_of(const Vector3& x) {
  return {static_cast<int>(std::floor(x.x())), static_cast<int>(std::floor(x.y()))};
}

/// The first of the visible points by number, so that neighbouring keyframes choose the same ones.
std::vector<int> visible_points(const Scene& scene, const std::map<Cell, std::vector<int>>& cells,
                                const SE3& T_k_w, int max_count) {
  const Vector3 centre = T_k_w.inverse().translation();
  const Cell low = cell_of(centre - Vector3::Constant(kViewRadius));
  const Cell high = cell_of(centre + Vector3::Constant(kViewRadius));
  std::vector<int> visible;
  for (int x = low.first; x <= high.first; ++x) {
    for (int y = low.second; y <= high.second; ++y) {
      const auto cell = cells.find({x, y});
      if (cell == cells.end()) continue;
      for (const int p : cell->second) {
        const Vector3 x_k = T_k_w * scene.points[static_cast<std::size_t>(p)];
        if (x_k.z() > 0.1 && scene.rig.camera.contains(scene.rig.camera.project(x_k), kBorderPx)) {
          visible.push_back(p);
        }
      }
    }
  }
  std::sort(visible.begin(), visible.end());
  if (visible.size() > static_cast<std::size_t>(max_count))
    visible.resize(static_cast<std::size_t>(max_count));
  return visible;
}

void find_covisible(Scene& scene, int min_covisible) {
  std::vector<std::vector<int>> observers(scene.points.size());
  for (int k = 0; k < scene.keyframes(); ++k) {
    std::map<int, int> shared;
    for (const Scene::Sighting& s : scene.seen[static_cast<std::size_t>(k)]) {
      auto& list = observers[static_cast<std::size_t>(s.point)];
      for (const int j : list) ++shared[j];
      list.push_back(k);
    }
    auto& covisible = scene.covisible.emplace_back();
    for (const auto& [j, count] : shared) {
      if (count >= min_covisible) covisible.push_back(j);
    }
  }
}

Scene make_scene(const SceneOptions& options, const Rig& rig, std::vector<Vector3> points,
                 std::vector<SE3> path, unsigned seed) {
  Scene scene;
  scene.rig = rig;
  scene.rig.noise.sigma_px = options.noise_px;
  scene.points = std::move(points);
  scene.T_k_w = std::move(path);
  std::map<Cell, std::vector<int>> cells;
  for (std::size_t p = 0; p < scene.points.size(); ++p) {
    cells[cell_of(scene.points[p])].push_back(static_cast<int>(p));
  }
  std::mt19937 rng(seed);
  std::normal_distribution<double> noise(0, options.noise_px);
  for (const SE3& T_k_w : scene.T_k_w) {
    auto& seen = scene.seen.emplace_back();
    for (const int p : visible_points(scene, cells, T_k_w, options.max_sightings)) {
      StereoPixel z = scene.rig.project(T_k_w * scene.points[static_cast<std::size_t>(p)]);
      for (int c = 0; c < 3; ++c) z[c] += noise(rng);
      seen.push_back({p, z});
    }
  }
  find_covisible(scene, options.min_covisible);
  return scene;
}

/// Camera on a circle in the plane z = 0 around the origin, its x axis along the circle.
SE3 looking_outwards(double radius, double angle) {
  Matrix3 R_w_c;
  R_w_c.col(0) << -std::sin(angle), std::cos(angle), 0;
  R_w_c.col(2) << std::cos(angle), std::sin(angle), 0;
  R_w_c.col(1) = R_w_c.col(2).cross(R_w_c.col(0));
  return SE3(R_w_c, radius * R_w_c.col(2)).inverse();
}

/// Points on a cylinder of height 2 m around the z axis.
std::vector<Vector3> ring(double radius, long count, unsigned seed) {
  std::mt19937 rng(seed);
  std::uniform_real_distribution<double> angle(-std::numbers::pi, std::numbers::pi), height(-1, 1);
  std::vector<Vector3> points;
  for (long n = 0; n < count; ++n) {
    const double a = angle(rng), z = height(rng);
    points.emplace_back(radius * std::cos(a), radius * std::sin(a), z);
  }
  return points;
}

}  // namespace

double Scene::median_depth(int keyframe) const {
  const auto k = static_cast<std::size_t>(keyframe);
  std::vector<double> depths;
  for (const Sighting& s : seen[k])
    depths.push_back((T_k_w[k] * points[static_cast<std::size_t>(s.point)]).z());
  if (depths.empty()) return 1;
  std::nth_element(depths.begin(), depths.begin() + static_cast<std::ptrdiff_t>(depths.size() / 2),
                   depths.end());
  return depths[depths.size() / 2];
}

Scene spiral_scene(const SceneOptions& options, SensorKind kind, int keyframes, unsigned seed) {
  std::vector<SE3> path = simulation::spiral_path(keyframes, options.step, options.spacing, options.height);
  std::vector<Vector3> points = simulation::scattered_points(path, 2, options.density, seed);
  return make_scene(options, simulation::thesis_rig(kind), std::move(points), std::move(path), seed);
}

Scene double_loop_scene(const SceneOptions& options, int keyframes, unsigned seed) {
  // Keyframes of the second round, and the one that begins the third, stand a third of a step beside those of
  // the first: the direction between two that coincide is not defined.
  const double laps = keyframes / (keyframes / 2.0 - 1.0 / 3);
  const double radius = 10 * keyframes / 300.0;
  std::vector<SE3> path;
  for (int k = 0; k < keyframes; ++k) {
    path.push_back(looking_outwards(radius, 2 * std::numbers::pi * laps * k / keyframes));
  }
  Rig rig;
  rig.kind = SensorKind::kMono;
  rig.camera = {195, 195, 162, 125, 320, 240};  // as in the scale drift experiment
  return make_scene(options, rig, ring(radius + 1, std::lround(500 * radius), seed), std::move(path), seed);
}

}  // namespace twofold::bench
