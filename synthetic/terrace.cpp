#include <array>
#include <cmath>
#include <numbers>

#include "synthetic/furniture.hpp"
#include "synthetic/materials.hpp"
#include "synthetic/scenes.hpp"
#include "synthetic/wall_fixtures.hpp"

namespace twofold::synthetic {
namespace {

constexpr double kRadius = 500;  ///< of the ring road [m]
constexpr double kWaves = 0.09;  ///< its bends, in shares of the radius
constexpr double kTerraceWay =
    3000;  ///< driven in one round: not all of the ring, so that nothing is seen again [m]
constexpr double kTerraceSpeed = 8;     ///< [m/s]
constexpr double kCamera = 1.5;         ///< height [m]
constexpr double kTerraceHouse = 8;     ///< from one house to the next [m]
constexpr int kHouses = 4;              ///< that differ: the street repeats every 32 m
constexpr double kTerraceAside = 7.5;   ///< of fronts from the middle of the road [m]
constexpr double kTerraceTexel = 0.03;  ///< of houses [m]
constexpr double kTerraceTile = 8;      ///< length of a piece of road [m]
constexpr double kHalfRoad = 8;         ///< [m]

const Vector3 kHouseSize(7.4, 5, 6);

ClosedCurve ring_road() {
  std::vector<Vector2> points;
  constexpr int kPoints = 160;
  for (int i = 0; i < kPoints; ++i) {
    const double angle = 2 * std::numbers::pi * i / kPoints;
    const double radius = kRadius * (1 + kWaves * std::sin(5 * angle));
    points.emplace_back(radius * std::cos(angle), radius * std::sin(angle));
  }
  return ClosedCurve(points);
}

/// A place beside the road, `aside` to its left, and the heading there.
SE3 beside(const ClosedCurve& road, double s, double aside, double z) {
  const double heading = road.heading(s);
  const Vector2 p = road.position(s) + aside * Vector2(-std::sin(heading), std::cos(heading));
  return standing(p.x(), p.y(), z, heading);
}

/// First texture of each of the houses that differ: all others are copies to the last grain.
std::array<int, kHouses> paint_houses(Scene& scene, Random& random) {
  std::array<int, kHouses> first{};
  for (int h = 0; h < kHouses; ++h) {
    first[static_cast<std::size_t>(h)] = add_box_textures(scene, kHouseSize, kTerraceTexel, [&](Canvas& c) {
      if (c.height() > kHouseSize.y()) paint_facade(c, random, h);  // not the roof
    });
  }
  return first;
}

void line_with_houses(Scene& scene, Random& random, const ClosedCurve& road) {
  const std::array<int, kHouses> first = paint_houses(scene, random);
  const auto count =
      static_cast<int>((kTerraceWay + 200) / kTerraceHouse);  // as far as is seen from the end of the way
  const SE3 turned = standing(0, 0, 0, std::numbers::pi);
  for (int n = 0; n < count; ++n) {
    for (const double side : {1.0, -1.0}) {
      const double aside = side * (kTerraceAside + 0.5 * kHouseSize.y());
      const SE3 at = beside(road, n * kTerraceHouse, aside, 0.5 * kHouseSize.z());
      const int kind = (n + (side > 0 ? 0 : 2)) % kHouses;
      // The front of a box looks along its -y.
      for (const Quad& quad :
           box_quads(side > 0 ? at : at * turned, kHouseSize, first[static_cast<std::size_t>(kind)]))
        scene.quads.push_back(quad);
    }
  }
}

void pave(Scene& scene, Random& random, const ClosedCurve& road) {
  std::array<int, kHouses> textures{};
  for (int& texture : textures) {
    Canvas canvas(kTerraceTile + 0.6, 2 * kHalfRoad, 0.04, 120);
    paint_paving(canvas, random, 0.8, 120);
    scatter_specks(canvas, random, 3, 0.05, 0.2, 60);
    texture = scene.add(canvas.finish());
  }
  const auto count = static_cast<int>((kTerraceWay + 200) / kTerraceTile);
  for (int n = 0; n < count; ++n) {
    // Pieces overlap a little in bends: one of two lies higher by the thickness of paint.
    const SE3 at = beside(road, n * kTerraceTile, kHalfRoad, 0.002 * (n % 2));
    scene.quads.push_back({at.translation(), at.so3() * Vector3::UnitX(), at.so3() * -Vector3::UnitY(),
                           kTerraceTile + 0.6, 2 * kHalfRoad, textures[static_cast<std::size_t>(n % kHouses)],
                           0.95});
  }
}

/// By car: no step, a little pitch and roll of the springs.
CameraPath drive(const ClosedCurve& road) {
  return [road](double t) {
    const double s = kTerraceSpeed * t;
    const SE3 at = beside(road, s, 0.4 * std::sin(0.11 * t), kCamera + 0.01 * std::sin(5 * t));
    const double yaw = road.heading(s) + 0.015 * std::sin(0.5 * t);
    return looking(at.translation(), yaw, -0.03 + 0.006 * std::sin(3.1 * t), 0.006 * std::sin(2.3 * t + 1));
  };
}

}  // namespace

/// 3 km along terraced houses that are copies of four, on a road that does not come back: every place looks
/// as it did 32 m ago, and none was seen before.
Staging make_terrace(std::uint64_t seed) {
  Staging staging;
  Random random(mix64(seed) ^ 0x746572726163ULL);
  const ClosedCurve road = ring_road();
  line_with_houses(staging.scene, random, road);
  pave(staging.scene, random, road);
  staging.path = drive(road);
  staging.round_seconds = kTerraceWay / kTerraceSpeed;
  staging.object_size = {0.5, 0.35, 1.75};
  staging.object_texture = add_box_textures(staging.scene, staging.object_size, kTerraceTexel,
                                            [&](Canvas& c) { paint_plaster(c, random, 110); });
  staging.T_w_object = [road](double t) { return beside(road, kTerraceSpeed * t + 8, 3, 0.875); };
  return staging;
}

}  // namespace twofold::synthetic
