#include <cmath>
#include <numbers>

#include "synthetic/furniture.hpp"
#include "synthetic/materials.hpp"
#include "synthetic/scenes.hpp"
#include "synthetic/wall_fixtures.hpp"

namespace twofold::synthetic {
namespace {

constexpr double kDeskTexel = 0.0012;
constexpr double kTop = 0.74;       ///< height of the desk [m]
constexpr double kDeskHalfX = 1.3;  ///< half its length
constexpr double kDeskRound = 24;   ///< [s] back and forth

void paint_cover(Canvas& canvas, Random& random) {
  canvas.rectangle(0, 0, canvas.width(), canvas.height(), static_cast<float>(random.uniform(60, 200)));
  const double unit = std::min(canvas.width(), canvas.height());
  if (unit > 0.05)
    draw_poster(canvas, random, 0.1 * canvas.width(), 0.06 * canvas.height(), 0.8 * canvas.width(),
                0.85 * canvas.height());
  canvas.add_noise(random.word(), 10, 0.5 * unit, 0.003, 0.85f);
  scatter_specks(canvas, random, 20 / (unit * unit), 0.02 * unit, 0.09 * unit, 45);
}

void add_room(Scene& scene, Random& random) {
  Canvas top(2 * kDeskHalfX, 1.0, kDeskTexel, 150);
  paint_planks(top, random, 0.14, 150);
  for (int i = 0; i < 14; ++i) {  // sheets of paper with text
    const double x = random.uniform(0, 2 * kDeskHalfX - 0.3);
    draw_poster(top, random, x, random.uniform(0.35, 0.8), 0.18, 0.24);
  }
  scatter_specks(top, random, 500, 0.002, 0.012, 45);
  scene.quads.push_back({{-kDeskHalfX, 0.5, kTop},
                         Vector3::UnitX(),
                         -Vector3::UnitY(),
                         2 * kDeskHalfX,
                         1.0,
                         scene.add(top.finish()),
                         1.0});
  Canvas wall(6.0, 3.2, 0.002, 150);
  paint_plaster(wall, random, 165);
  for (double x = 0.2; x < 5.5;) {
    const double w = random.uniform(0.3, 0.6);
    const double h = w * random.uniform(0.9, 1.3);
    draw_poster(wall, random, x, 3.2 - random.uniform(1.75, 2.1), w, h);
    draw_poster(wall, random, x + 0.03, 3.2 - random.uniform(1.2, 1.3), 0.8 * w, 0.35);
    x += w + random.uniform(0.05, 0.25);
  }
  scatter_specks(wall, random, 150, 0.004, 0.03, 40);
  scene.quads.push_back(
      {{-3, 0.62, 3.2}, Vector3::UnitX(), -Vector3::UnitZ(), 6.0, 3.2, scene.add(wall.finish()), 0.95});
  Canvas floor(6.0, 4.0, 0.004, 120);
  paint_planks(floor, random, 0.16, 110);
  scene.quads.push_back(
      {{-3, 0.62, 0}, Vector3::UnitX(), -Vector3::UnitY(), 6.0, 4.0, scene.add(floor.finish()), 0.8});
}

void add_things(Scene& scene, Random& random) {
  for (int column = 0; column < 11; ++column) {
    for (int row = 0; row < 3; ++row) {
      const double x = -1.15 + 0.23 * column + random.uniform(-0.04, 0.04);
      const double y = -0.28 + 0.27 * row + random.uniform(-0.04, 0.04);
      const double yaw = random.uniform(-0.6, 0.6);
      const auto tone = static_cast<float>(random.uniform(70, 190));
      const auto cover = [&](Canvas& c) { paint_cover(c, random); };
      const double tall = 0.07 + 0.06 * row;  // low things in front
      switch (random.below(4)) {
        case 0: {  // pile of books
          double z = kTop;
          for (int i = 0; i < 1 + row + random.below(2); ++i) {
            const double h = random.uniform(0.02, 0.045);
            const double width = random.uniform(0.13, 0.19);
            const double depth = random.uniform(0.1, 0.14);
            const double turn = random.uniform(-0.3, 0.3);
            add_box(scene, standing(x, y, z + 0.5 * h, yaw + turn), {width, depth, h}, kDeskTexel, cover);
            z += h;
          }
          break;
        }
        case 1: {  // tin or mug, with a lid
          const double r = random.uniform(0.03, 0.055);
          const double h = random.uniform(0.7, 1.2) * tall;
          add_cylinder(scene, {x, y, kTop}, r, h, kDeskTexel, cover);
          add_box(scene, standing(x, y, kTop + h + 0.006, yaw), {1.2 * r, 1.2 * r, 0.012}, kDeskTexel, cover);
          break;
        }
        case 2: {
          const double r = random.uniform(0.03, 0.06);
          add_ball(scene, {x, y, kTop + r}, r, kDeskTexel, [&](Canvas& c) { paint_metal(c, random, tone); });
          break;
        }
        default: {
          Vector3 size = random_size(random, {0.07, 0.05, 0.7}, {0.15, 0.11, 1.5});
          size.z() *= tall;
          add_box(scene, standing(x, y, kTop + 0.5 * size.z(), yaw), size, kDeskTexel, cover);
        }
      }
    }
  }
}

SE3 browse(double t) {
  const double phase = 2 * std::numbers::pi * t / kDeskRound;
  const double x = -0.75 * std::cos(phase);
  const Vector3 eye(x, -0.84 + 0.1 * std::sin(2.1 * phase), 1.17 + 0.06 * std::sin(1.7 * phase + 0.6));
  const double yaw = 0.5 * std::numbers::pi + 0.16 * std::sin(1.3 * phase) - 0.12 * std::cos(phase) +
                     0.02 * std::sin(2 * std::numbers::pi * 0.9 * t);
  const double pitch =
      -0.5 + 0.08 * std::sin(1.9 * phase + 1) + 0.008 * std::sin(2 * std::numbers::pi * 1.3 * t);
  const double roll = 0.05 * std::sin(1.1 * phase + 0.3);
  return looking(eye, yaw, pitch, roll);
}

}  // namespace

Staging make_desk(std::uint64_t seed) {
  Staging staging;
  Random random(mix64(seed) ^ 0x6465736bULL);
  add_room(staging.scene, random);
  add_things(staging.scene, random);
  staging.path = browse;
  staging.round_seconds = kDeskRound;
  staging.object_size = {0.11, 0.08, 0.15};  // a carton carried across the desk
  staging.object_texture = add_box_textures(staging.scene, staging.object_size, kDeskTexel,
                                            [&](Canvas& c) { paint_cover(c, random); });
  staging.T_w_object = [](double t) {
    return standing(0.9 * std::sin(0.5 * t), -0.35 + 0.1 * std::cos(0.8 * t), kTop + 0.2, 0.4 * t);
  };
  return staging;
}

}  // namespace twofold::synthetic
