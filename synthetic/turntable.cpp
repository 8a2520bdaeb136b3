#include <array>
#include <cmath>
#include <numbers>

#include "synthetic/furniture.hpp"
#include "synthetic/materials.hpp"
#include "synthetic/scenes.hpp"
#include "synthetic/wall_fixtures.hpp"

namespace twofold::synthetic {
namespace {

constexpr double kTurntableTexel = 0.0005;
constexpr double kPlate = 0.34;         // edge of the plate that turns [m]
constexpr double kTableBelow = 0.02;    // the plate [m]
constexpr double kTurntableRound = 10;  // [s]: 36 degrees a second
constexpr double kAway = 0.5;           // camera to the object's middle [m]
constexpr double kMiddle = 0.07;        // of the object, above the plate [m]
constexpr double kDown = 0.55;          // the camera looks down [rad]

void paint_prints(Canvas& canvas, Random& random) {
  canvas.rectangle(0, 0, canvas.width(), canvas.height(), static_cast<float>(random.uniform(120, 200)));
  for (double y = 0.004; y < canvas.height() - 0.02; y += random.uniform(0.026, 0.036))
    for (double x = 0.003; x < canvas.width() - 0.015; x += random.uniform(0.026, 0.04)) {
      const double height = random.uniform(0.018, 0.026);
      draw_poster(canvas, random, x, y, random.uniform(0.018, 0.026), height);
    }
  scatter_specks(canvas, random, 12000, 0.0006, 0.002, 60);
}

void paint_wood(Canvas& canvas, Random& random) {
  paint_planks(canvas, random, 0.022, 150);
  canvas.add_noise(random.word(), 14, 0.02, 0.001, 0.85f);
  scatter_specks(canvas, random, 20000, 0.0008, 0.0035, 55);
}

void paint_stone(Canvas& canvas, Random& random) {
  paint_bricks(canvas, random, 0.019, 0.011, 140);
  canvas.add_noise(random.word(), 22, 0.012, 0.001, 0.9f);
  scatter_specks(canvas, random, 15000, 0.0008, 0.003, 50);
}

void add_object(Scene& scene, Random& random, int shape, int texture) {
  using Painter = void (*)(Canvas&, Random&);
  constexpr std::array<Painter, kTurntableTextures> kPainters{paint_prints, paint_wood, paint_stone};
  const auto paint = [&](Canvas& c) { kPainters[static_cast<std::size_t>(texture)](c, random); };
  if (shape == 0) {  // a carton, not in the middle
    add_box(scene, standing(0.012, -0.008, 0.075, 0.4), {0.1, 0.08, 0.15}, kTurntableTexel, paint);
  } else {  // a jar with a round lid
    add_cylinder(scene, {0.006, 0.004, 0}, 0.05, 0.08, kTurntableTexel, paint);
    add_ball(scene, {0.006, 0.004, 0.088}, 0.062, kTurntableTexel, paint);
  }
}

/// Once around in kTurntableRound, the other way than the plate turns.
double angle_at(double t) {
  return -2 * std::numbers::pi * t / kTurntableRound;
}

SE3 around(double t) {
  const double angle = angle_at(t);
  const Vector3 eye(kAway * std::cos(kDown) * std::cos(angle), kAway * std::cos(kDown) * std::sin(angle),
                    kMiddle + kAway * std::sin(kDown));
  return looking(eye, angle + std::numbers::pi, -kDown, 0);
}

/// The plate, and a table and a wall that stand still before the camera.
struct Surroundings {
  int plate, table, wall;  ///< textures

  void append(double t, std::vector<Quad>& quads) const {
    const double half = 0.5 * kPlate;
    quads.push_back({{-half, half, 0}, Vector3::UnitX(), -Vector3::UnitY(), kPlate, kPlate, plate, 0.9});
    const SO3 turn = SO3::exp(Vector3(0, 0, angle_at(t)));
    quads.push_back({turn * Vector3(-0.75, 0.8, -kTableBelow), turn * Vector3::UnitX(),
                     turn * Vector3(-Vector3::UnitY()), 1.3, 1.6, table, 0.9});
    quads.push_back({turn * Vector3(-0.75, -0.8, 0.9), turn * Vector3::UnitY(),
                     turn * Vector3(-Vector3::UnitZ()), 1.6, 0.92, wall, 0.9});
  }
};

int painted(Scene& scene, double width, double height, Random& random, float grey) {
  Canvas canvas(width, height, 0.001, grey);
  paint_plaster(canvas, random, grey);
  scatter_specks(canvas, random, 1500, 0.002, 0.009, 50);
  return scene.add(canvas.finish());
}

}  // namespace

Staging make_turntable(std::uint64_t seed, int shape, int texture) {
  Staging staging;
  Random random(mix64(seed) ^ 0x7475726eULL);
  add_object(staging.scene, random, shape, texture);
  Surroundings surroundings{};
  surroundings.plate = painted(staging.scene, kPlate, kPlate, random, 150);
  surroundings.table = painted(staging.scene, 1.3, 1.6, random, 120);
  surroundings.wall = painted(staging.scene, 1.6, 0.92, random, 170);
  staging.path = around;
  staging.round_seconds = kTurntableRound;
  staging.surroundings = [surroundings](double t, std::vector<Quad>& quads) {
    surroundings.append(t, quads);
  };
  return staging;
}

}  // namespace twofold::synthetic
