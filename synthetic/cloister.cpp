#include <array>
#include <cmath>
#include <numbers>

#include "synthetic/furniture.hpp"
#include "synthetic/materials.hpp"
#include "synthetic/scenes.hpp"
#include "synthetic/wall_fixtures.hpp"

namespace twofold::synthetic {
namespace {

constexpr double kHalf = 13;  ///< inner half width of the square [m]
constexpr double kHeight = 6;
constexpr double kCloisterTexel = 0.012;
constexpr double kWay = 8;              ///< half width of the square walked round
constexpr double kCloisterSpeed = 1.3;  ///< [m/s]
constexpr double kArcade = 1.6;         ///< of its columns from the wall [m]

void add_side(Scene& scene, Random& random, int side) {
  const double turn = 0.5 * std::numbers::pi * side;
  const SO3 R(SO3::exp(Vector3(0, 0, turn)));
  const Vector3 left_top = R * Vector3(-kHalf, kHalf, kHeight);
  const Vector3 along = R * Vector3::UnitX();
  Canvas canvas(2 * kHalf, kHeight, kCloisterTexel, 128);
  paint_facade(canvas, random, side);
  scene.quads.push_back({left_top, along, -Vector3::UnitZ(), 2 * kHalf, kHeight, scene.add(canvas.finish()),
                         0.85 + 0.05 * side});
  for (double x = -kHalf + 2; x < kHalf - 1; x += random.uniform(2.6, 3.8)) {
    const Vector3 foot = R * Vector3(x, kHalf - kArcade, 0);
    const double height = random.uniform(2.6, 3.4);
    add_cylinder(scene, foot, random.uniform(0.12, 0.2), height, kCloisterTexel, [&](Canvas& c) {
      paint_ashlar(c, random, 0.3, static_cast<float>(random.uniform(110, 190)));
    });
  }
}

}  // namespace

/// Sideways round the square, the walls to the right, as Keble College in thesis 5.4: what is in view changes
/// fast, nothing is seen for long, and at the corners the camera turns.
Staging make_cloister(std::uint64_t seed) {
  Staging staging;
  Random random(mix64(seed) ^ 0x636c6f6973ULL);
  for (int side = 0; side < 4; ++side) add_side(staging.scene, random, side);
  Canvas ground(2 * kHalf, 2 * kHalf, 0.02, 128);
  paint_paving(ground, random, 0.6, 125);
  ground.add_noise(random.word(), 8, 0.6, 0.05, 0.9f);
  staging.scene.quads.push_back({{-kHalf, kHalf, 0},
                                 Vector3::UnitX(),
                                 -Vector3::UnitY(),
                                 2 * kHalf,
                                 2 * kHalf,
                                 staging.scene.add(ground.finish()),
                                 0.95});
  std::vector<Vector2> ring;
  const std::array<Vector2, 5> corners{
      {{-kWay, -kWay}, {kWay, -kWay}, {kWay, kWay}, {-kWay, kWay}, {-kWay, -kWay}}};
  for (std::size_t c = 0; c + 1 < corners.size(); ++c) {
    for (int i = 0; i < 8; ++i) ring.emplace_back(corners[c] + (corners[c + 1] - corners[c]) * (i / 8.0));
  }
  const ClosedCurve curve(ring);
  WalkStyle style;
  style.speed = kCloisterSpeed;
  style.outward_deg = 90;
  style.look_aside_deg = 4;
  staging.path = walk(curve, style);
  staging.round_seconds = curve.length() / kCloisterSpeed;
  staging.object_size = {0.5, 0.35, 1.75};
  staging.object_texture = add_box_textures(staging.scene, staging.object_size, kCloisterTexel,
                                            [&](Canvas& c) { paint_plaster(c, random, 110); });
  staging.T_w_object = [](double t) { return standing(9.5 * std::sin(0.2 * t), 9.5, 0.875, 0.2 * t); };
  return staging;
}

}  // namespace twofold::synthetic
