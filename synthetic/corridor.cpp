#include <cmath>
#include <numbers>

#include "synthetic/furniture.hpp"
#include "synthetic/materials.hpp"
#include "synthetic/scenes.hpp"
#include "synthetic/wall_fixtures.hpp"

namespace twofold::synthetic {
namespace {

constexpr double kHalfLength = 12;
constexpr double kHalfWidth = 1.7;
constexpr double kLane = 0.85;  ///< of the walk from the middle, and radius of its turns [m]
constexpr double kCeiling = 2.8;
constexpr double kCorridorTexel = 0.004;
constexpr double kCorridorSpeed = 1.0;

void paint_wall(Canvas& canvas, Random& random) {
  paint_plaster(canvas, random, static_cast<float>(random.uniform(150, 190)));
  canvas.rectangle(0, canvas.height() - 0.12, canvas.width(), 0.12, 75);  // skirting board
  for (double x = random.uniform(0.3, 0.8); x < canvas.width() - 1.2;) {
    const double kind = random.uniform(0, 1);
    double w = random.uniform(0.4, 0.9);
    if (kind < 0.3) {
      w = random.uniform(0.85, 1.0);
      draw_door(canvas, random, x, canvas.height() - 2.05, w, 2.05);
    } else {
      const double h = w * random.uniform(0.8, 1.3);
      draw_poster(canvas, random, x, 0.7 + random.uniform(0, 0.3), w, h);
      if (kind > 0.6) draw_poster(canvas, random, x + 0.1, 1.95, 0.45 * w, 0.5 * w);
    }
    x += w + random.uniform(0.2, 0.7);
  }
  scatter_specks(canvas, random, 19, 0.01, 0.06, 40);
}

void add_shell(Scene& scene, Random& random, const PlainPanels& plain) {
  const double l = kHalfLength;
  const double w = kHalfWidth;
  const Vector3 x = Vector3::UnitX();
  const Vector3 y = Vector3::UnitY();
  const Vector3 z = Vector3::UnitZ();
  const std::array<Quad, 4> walls{{{{-l, w, kCeiling}, x, -z, 2 * l, kCeiling, 0, 0.95},
                                   {{l, w, kCeiling}, -y, -z, 2 * w, kCeiling, 0, 0.85},
                                   {{l, -w, kCeiling}, -x, -z, 2 * l, kCeiling, 0, 1.0},
                                   {{-l, -w, kCeiling}, y, -z, 2 * w, kCeiling, 0, 0.85}}};
  for (Quad wall : walls) {
    Canvas canvas(wall.width, wall.height, kCorridorTexel, 160);
    paint_wall(canvas, random);
    plain.paint(canvas, scene.textures.size());
    wall.texture = scene.add(canvas.finish());
    scene.quads.push_back(wall);
  }
  Canvas floor(2 * l, 2 * w, kCorridorTexel, 130);
  paint_paving(floor, random, 0.33, 125);
  scene.quads.push_back({{-l, w, 0}, x, -y, 2 * l, 2 * w, scene.add(floor.finish()), 0.9});
  Canvas ceiling(2 * l, 2 * w, kCorridorTexel, 190);
  paint_paving(ceiling, random, 0.6, 185);
  for (double at = 0.8; at < 2 * l - 1.3; at += random.uniform(1.7, 2.4))
    ceiling.rectangle(at, w - 0.15, 1.2, 0.3, 250);  // lamps
  scene.quads.push_back({{-l, -w, kCeiling}, x, y, 2 * l, 2 * w, scene.add(ceiling.finish()), 0.9});
}

void add_furniture(Scene& scene, Random& random) {
  for (double x = -10.8; x < 10.8; x += random.uniform(1.6, 2.6)) {
    const double side = random.chance(0.5) ? 1 : -1;
    const Vector3 size = random_size(random, {0.35, 0.25, 0.4}, {0.8, 0.35, 1.7});
    const auto tone = static_cast<float>(random.uniform(80, 190));
    const bool wooden = random.chance(0.5);
    add_box(scene, standing(x, side * (kHalfWidth - 0.5 * size.y() - 0.02), 0.5 * size.z(), 0), size, 0.003,
            [&](Canvas& c) {
              if (wooden)
                paint_planks(c, random, 0.1, tone);
              else
                paint_metal(c, random, tone);
              draw_poster(c, random, 0.2 * c.width(), 0.1 * c.height(), 0.4 * c.width(), 0.35 * c.width());
            });
  }
}

}  // namespace

Staging make_corridor(std::uint64_t seed, double plain) {
  Staging staging;
  Random random(mix64(seed) ^ 0x636f7272ULL);
  add_shell(staging.scene, random, {seed, plain});
  add_furniture(staging.scene, random);

  // Up on one side, around, and down on the other: the ring is a narrow stadium.
  std::vector<Vector2> ring;
  const auto turn = [&](double centre, double first_angle) {
    for (int i = 1; i < 6; ++i) {
      const double angle = first_angle + std::numbers::pi * i / 6;
      ring.emplace_back(centre + kLane * std::cos(angle), kLane * std::sin(angle));
    }
  };
  for (double x = -9; x <= 9; x += 0.5) ring.emplace_back(x, -kLane);
  turn(9, -0.5 * std::numbers::pi);
  for (double x = 9; x >= -9; x -= 0.5) ring.emplace_back(x, kLane);
  turn(-9, 0.5 * std::numbers::pi);
  const ClosedCurve curve(ring);
  WalkStyle style;
  style.speed = kCorridorSpeed;
  style.look_aside_deg = 12;
  staging.path = walk(curve, style);
  staging.round_seconds = curve.length() / kCorridorSpeed;
  staging.walking_speed = kCorridorSpeed;

  staging.object_size = {0.5, 0.35, 1.75};
  staging.object_texture =
      add_box_textures(staging.scene, staging.object_size, kCorridorTexel, [&](Canvas& c) {
        paint_plaster(c, random, 110);
        draw_poster(c, random, 0.05, 0.1, 0.25, 0.2);
      });
  staging.T_w_object = [](double t) {
    return standing(8 * std::sin(0.15 * t), 0.9, 0.875, 0.2 * std::sin(6 * t));
  };
  return staging;
}

}  // namespace twofold::synthetic
