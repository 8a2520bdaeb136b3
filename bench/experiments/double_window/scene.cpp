#include "experiments/double_window/scene.hpp"

#include <algorithm>
#include <cmath>
#include <map>
#include <numbers>
#include <random>

#include "tests/mapping/simulation.hpp"

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

void find_covisible(Scene& scene, int theta) {
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
      if (count >= theta) covisible.push_back(j);
    }
  }
}

Scene make_scene(const SceneOptions& options, SensorKind kind, std::vector<SE3> path, unsigned seed) {
  Scene scene;
  scene.rig = simulation::thesis_rig(kind);
  scene.points = simulation::scattered_points(path, 2, options.density, seed);
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
      Vector3 z = scene.rig.project(T_k_w * scene.points[static_cast<std::size_t>(p)]);
      for (int c = 0; c < 3; ++c) z[c] += noise(rng);
      seen.push_back({p, z});
    }
  }
  find_covisible(scene, options.theta);
  return scene;
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
  return make_scene(options, kind,
                    simulation::spiral_path(keyframes, options.step, options.spacing, options.height), seed);
}

Scene double_loop_scene(const SceneOptions& options, int keyframes, unsigned seed) {
  // Keyframes of the second round stand between those of the first: the direction between two that coincide
  // is not defined.
  const double laps = keyframes / (0.5 * keyframes - 0.5);
  const double radius = options.step * keyframes / (2 * std::numbers::pi * laps);
  return make_scene(options, SensorKind::kMono,
                    simulation::circle_path(keyframes, laps, radius, options.height), seed);
}

}  // namespace twofold::bench
