#pragma once

#include <algorithm>
#include <cmath>
#include <map>
#include <numbers>
#include <random>
#include <utility>
#include <vector>

#include "camera/rig.hpp"
#include "geometry/se3.hpp"

/// What a simulated camera sees, and where it goes. Metres.
namespace twofold::simulation {

inline constexpr double kCell = 1.0;  ///< side of the squares of the ground that points are sorted into

inline std::pair<int, int> cell_of(double x, double y) {
  return {static_cast<int>(std::floor(x / kCell)), static_cast<int>(std::floor(y / kCell))};
}

/// Stereo camera of thesis 6.5.1: f = 300, baseline 5 cm, 640 x 480.
inline Rig thesis_rig(SensorKind kind = SensorKind::kStereo) {
  Rig rig;
  rig.kind = kind;
  rig.camera = {300, 300, 319.5, 239.5, 640, 480};
  rig.baseline = 0.05;
  return rig;
}

/// Camera above the plane z = 0 at the given height, looking down, its x axis along `heading` [rad].
inline SE3 looking_down(double x, double y, double height, double heading) {
  Matrix3 R_w_c;
  R_w_c.col(0) << std::cos(heading), std::sin(heading), 0;
  R_w_c.col(2) << 0, 0, -1;
  R_w_c.col(1) = R_w_c.col(2).cross(R_w_c.col(0));
  return SE3(R_w_c, Vector3(x, y, height)).inverse();
}

/// Points around the plane z = 0 wherever the camera comes, `density` per square metre.
inline std::vector<Vector3> scattered_points(const std::vector<SE3>& path, double margin, double density,
                                             unsigned seed) {
  std::map<std::pair<int, int>, bool> near;
  const int reach = static_cast<int>(std::ceil(margin / kCell));
  for (const SE3& T_k_w : path) {
    const Vector3 centre = T_k_w.inverse().translation();
    const auto [cx, cy] = cell_of(centre.x(), centre.y());
    for (int x = cx - reach; x <= cx + reach; ++x) {
      for (int y = cy - reach; y <= cy + reach; ++y) near[{x, y}] = true;
    }
  }
  std::mt19937 rng(seed);
  std::uniform_real_distribution<double> uniform;
  std::vector<Vector3> points;
  for (const auto& [cell, yes] : near) {
    for (int n = 0; n < static_cast<int>(density * kCell * kCell); ++n) {
      const double x = (cell.first + uniform(rng)) * kCell, y = (cell.second + uniform(rng)) * kCell;
      points.emplace_back(x, y, 0.6 * (uniform(rng) - 0.5));
    }
  }
  std::shuffle(points.begin(), points.end(), rng);
  return points;
}

/// Archimedean spiral from the centre outwards: loopy and exploring at the same time  (fig. 6.9).
inline std::vector<SE3> spiral_path(int keyframes, double step, double spacing, double height) {
  std::vector<SE3> path;
  double angle = 1.5;
  for (int k = 0; k < keyframes; ++k) {
    const double radius = spacing * angle / (2 * std::numbers::pi);
    path.push_back(looking_down(radius * std::cos(angle), radius * std::sin(angle),
                                height + 0.1 * std::sin(0.37 * k), angle + 0.2 * std::sin(0.21 * k)));
    angle += step / std::hypot(radius, spacing / (2 * std::numbers::pi));
  }
  return path;
}

/// `laps` rounds of a circle.
inline std::vector<SE3> circle_path(int keyframes, double laps, double radius, double height) {
  std::vector<SE3> path;
  for (int k = 0; k < keyframes; ++k) {
    const double angle = 2 * std::numbers::pi * laps * k / keyframes;
    path.push_back(looking_down(radius * std::cos(angle), radius * std::sin(angle),
                                height + 0.1 * std::sin(0.37 * k), angle));
  }
  return path;
}

}  // namespace twofold::simulation
