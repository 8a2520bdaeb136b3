#include <array>
#include <cmath>
#include <numbers>

#include "synthetic/furniture.hpp"
#include "synthetic/materials.hpp"
#include "synthetic/scenes.hpp"
#include "synthetic/wall_fixtures.hpp"

namespace twofold::synthetic {
namespace {

constexpr double kHalfX = 9.5;  ///< inner half width of the court [m]
constexpr double kHalfY = 7.5;
constexpr double kWallHeight = 6.5;
constexpr double kCourtyardTexel = 0.005;
constexpr double kRound = 30;  ///< once around [s]

void add_walls(Scene& scene, Random& random, const PlainPanels& plain) {
  struct Wall {
    Vector3 left_top;
    Vector3 along;
    double length;
    double light;
  };
  const double h = kWallHeight;
  // Seen from inside, s runs to the right.
  const std::array<Wall, 4> walls{{{{-kHalfX, kHalfY, h}, Vector3::UnitX(), 2 * kHalfX, 0.95},
                                   {{kHalfX, kHalfY, h}, -Vector3::UnitY(), 2 * kHalfY, 0.85},
                                   {{kHalfX, -kHalfY, h}, -Vector3::UnitX(), 2 * kHalfX, 1.0},
                                   {{-kHalfX, -kHalfY, h}, Vector3::UnitY(), 2 * kHalfY, 0.9}}};
  int style = 0;
  for (const Wall& wall : walls) {
    Canvas canvas(wall.length, h, kCourtyardTexel, 128);
    paint_facade(canvas, random, style++);
    plain.paint(canvas, scene.textures.size());
    const int texture = scene.add(canvas.finish());
    scene.quads.push_back(
        {wall.left_top, wall.along, -Vector3::UnitZ(), wall.length, h, texture, wall.light});
  }
}

void add_ground(Scene& scene, Random& random) {
  Canvas canvas(2 * kHalfX, 2 * kHalfY, 0.006, 128);
  paint_paving(canvas, random, 0.5, 132);
  for (int i = 0; i < 40; ++i) {  // puddles, drains, leaves swept together
    const auto grey = static_cast<float>(random.uniform(50, 200));
    const double angle = random.uniform(0, 180);
    const double b = random.uniform(0.05, 0.25);
    const double a = random.uniform(0.1, 0.4);
    const double y = random.uniform(0, canvas.height());
    canvas.ellipse(random.uniform(0, canvas.width()), y, a, b, angle, grey);
  }
  canvas.add_noise(random.word(), 8, 0.4, 0.02, 0.9f);
  scatter_specks(canvas, random, 22, 0.01, 0.05, 45);
  const int texture = scene.add(canvas.finish());
  scene.quads.push_back(
      {{-kHalfX, kHalfY, 0}, Vector3::UnitX(), -Vector3::UnitY(), 2 * kHalfX, 2 * kHalfY, texture, 0.95});
}

void add_column(Scene& scene, Random& random, double x, double y, double radius, double height) {
  add_cylinder(scene, {x, y, 0}, radius, height, kCourtyardTexel, [&](Canvas& c) {
    paint_ashlar(c, random, 0.3, static_cast<float>(random.uniform(120, 185)));
    if (random.chance(0.6)) draw_poster(c, random, random.uniform(0.1, 0.4), height - 2.1, 0.5, 0.7);
  });
  const auto grey = static_cast<float>(random.uniform(110, 180));
  const auto stone = [&](Canvas& c) { paint_plaster(c, random, grey); };
  add_box(scene, standing(x, y, height + 0.12, 0), {2.6 * radius, 2.6 * radius, 0.24}, kCourtyardTexel,
          stone);
  add_box(scene, standing(x, y, 0.1, 0), {2.7 * radius, 2.7 * radius, 0.2}, kCourtyardTexel, stone);
}

void add_tree(Scene& scene, Random& random, double x, double y) {
  const double radius = random.uniform(0.13, 0.2);
  const double height = random.uniform(2.3, 2.8);
  add_cylinder(scene, {x, y, 0}, radius, height, 0.004, [&](Canvas& c) { paint_bark(c, random, 92); });
  for (int i = 0; i < 4; ++i) {
    const double r = random.uniform(0.55, 0.9);
    const double turn = 2 * std::numbers::pi * i / 3;
    const Vector3 offset =
        i < 3 ? Vector3(0.5 * std::cos(turn), 0.5 * std::sin(turn), 0.5) : Vector3(0, 0, 1.2);
    add_ball(scene, Vector3(x, y, height) + offset, r, 0.008,
             [&](Canvas& c) { paint_foliage(c, random, 0.07, 105); });
  }
}

void add_centre(Scene& scene, Random& random, const PlainPanels& plain) {
  // A small pavilion with four different walls, columns around it, and benches and planters on the way.
  int style = 0;
  add_box(scene, standing(0.3, -0.2, 1.5, 0.12), {4.2, 2.6, 3.0}, kCourtyardTexel, [&](Canvas& canvas) {
    paint_facade(canvas, random, (style++ * 3 + 1) % 4);
    plain.paint(canvas, scene.textures.size());
  });
  add_column(scene, random, -4.1, 2.1, 0.28, 3.4);
  add_column(scene, random, 4.3, 2.3, 0.24, 3.1);
  add_column(scene, random, 4.2, -2.2, 0.3, 3.5);
  add_column(scene, random, -4.0, -2.3, 0.25, 3.2);
  add_column(scene, random, 0.2, 3.0, 0.2, 2.9);
  add_tree(scene, random, -2.2, -2.9);
  add_tree(scene, random, 2.3, 2.9);
}

void add_rim(Scene& scene, Random& random) {
  for (const auto& [x, y] : {std::pair{-8.3, 6.4}, {8.2, 6.3}, {8.4, -6.2}, {-8.2, -6.3}})
    add_tree(scene, random, x, y);
  // Pilasters stand before the walls and give them depth.
  for (const double x : {-6.1, -2.4, 1.7, 5.6}) {
    for (const double side : {-1.0, 1.0}) {
      const double w = random.uniform(0.35, 0.6);
      const auto grey = static_cast<float>(random.uniform(100, 190));
      add_box(scene, standing(x + random.uniform(-0.4, 0.4), side * (kHalfY - 0.2), 2.4, 0), {w, 0.4, 4.8},
              kCourtyardTexel, [&](Canvas& c) { paint_ashlar(c, random, 0.3, grey); });
    }
  }
  // Benches, planters, crates along the walls.
  const std::array<std::pair<double, double>, 10> spots{{{-4.2, 6.7},
                                                         {-0.3, 6.6},
                                                         {3.6, 6.7},
                                                         {8.7, 3.1},
                                                         {8.7, -0.4},
                                                         {8.6, -3.4},
                                                         {3.8, -6.6},
                                                         {-0.5, -6.7},
                                                         {-4.4, -6.6},
                                                         {-8.7, 0.5}}};
  for (const auto& [x, y] : spots) {
    const Vector3 size = random_size(random, {0.6, 0.45, 0.45}, {1.2, 0.8, 1.1});
    const auto grey = static_cast<float>(random.uniform(90, 170));
    const int kind = random.below(4);
    add_box(scene, standing(x, y, 0.5 * size.z(), random.uniform(-0.5, 0.5)), size, 0.004, [&](Canvas& c) {
      if (kind == 0)
        paint_planks(c, random, 0.12, grey);
      else if (kind == 1)
        paint_foliage(c, random, 0.06, grey);
      else if (kind == 2)
        paint_bricks(c, random, 0.2, 0.07, grey);
      else
        paint_plaster(c, random, grey);
      if (kind == 3)
        draw_poster(c, random, 0.15 * c.width(), 0.12 * c.height(), 0.6 * c.width(), 0.7 * c.height());
    });
  }
}

}  // namespace

Staging make_courtyard(std::uint64_t seed, double plain) {
  Staging staging;
  Random random(mix64(seed) ^ 0x636f757274ULL);
  add_walls(staging.scene, random, {seed, plain});
  add_ground(staging.scene, random);
  add_centre(staging.scene, random, {seed, plain});
  add_rim(staging.scene, random);

  // A rounded rectangle, anticlockwise, 3 m from the walls.
  std::vector<Vector2> ring;
  constexpr int kPoints = 24;
  for (int i = 0; i < kPoints; ++i) {
    const double a = 2 * std::numbers::pi * i / kPoints;
    const double c = std::cos(a);
    const double s = std::sin(a);
    const double r = std::pow(std::pow(std::abs(c / 6.9), 4) + std::pow(std::abs(s / 4.9), 4), -0.25);
    ring.emplace_back(r * c, r * s);
  }
  const ClosedCurve curve(ring);
  WalkStyle style;
  style.speed = curve.length() / kRound;
  staging.path = walk(curve, style);
  staging.round_seconds = kRound;
  staging.walking_speed = style.speed;

  // Somebody walks the same way some metres ahead, at a changing distance.
  staging.object_size = {0.5, 0.35, 1.75};
  staging.object_texture = add_box_textures(staging.scene, staging.object_size, 0.004, [&](Canvas& c) {
    paint_plaster(c, random, 110);
    draw_poster(c, random, 0.05, 0.1, 0.25, 0.2);
  });
  staging.T_w_object = [curve](double t) {
    const double s = curve.length() / kRound * t + 4.5 + 1.5 * std::sin(0.35 * t);
    const Vector2 p = curve.position(s);
    return standing(p.x(), p.y(), 0.875, curve.heading(s) + 0.15 * std::sin(6 * t));
  };
  return staging;
}

}  // namespace twofold::synthetic
