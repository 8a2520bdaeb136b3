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
constexpr double kCarriedRound = 15;    // [s]: once around by hand
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

/// By hand: nearer and farther, up and down, and never straight at the thing.
SE3 carried_around(double t) {
  const double angle = 2 * std::numbers::pi * t / kCarriedRound;
  const double away = kAway + 0.04 * std::sin(0.9 * t);
  const double down = kDown + 0.12 * std::sin(0.7 * t + 1);
  const Vector3 eye(away * std::cos(down) * std::cos(angle), away * std::cos(down) * std::sin(angle),
                    kMiddle + away * std::sin(down));
  return looking(eye, angle + std::numbers::pi + 0.05 * std::sin(2.3 * t), -down + 0.03 * std::sin(3.1 * t),
                 0.06 * std::sin(1.7 * t));
}

/// Where a thing stands, in the room, that is held and turned by hand: once around its axis in
/// kTurntableRound, which leans to all sides meanwhile.
SE3 held(double t) {
  const Vector3 middle(0, 0, kMiddle);
  const Vector3 shift(0.03 * std::sin(0.8 * t), 0.04 * std::sin(0.57 * t), 0.02 * std::sin(1.1 * t));
  const SO3 lean = SO3::exp(Vector3(0.35 * std::sin(0.83 * t), 0.3 * std::sin(0.61 * t), 0));
  const SO3 turn = SO3::exp(Vector3(0, 0, -angle_at(t)));
  return SE3(SO3(), middle + shift) * SE3(lean * turn, Vector3::Zero()) * SE3(SO3(), -middle);
}

/// The plate, and a table and a wall that stand still before the camera.
struct TurningPlate {
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

/// Table and walls around a camera that walks.
struct StandingRoom {
  int table, floor, wall;  ///< textures

  void append(std::vector<Quad>& quads) const {
    constexpr double kHalfTable = 0.5, kHalfRoom = 2, kFloor = -0.75, kHigh = 2.4;  // [m]
    quads.push_back({{-kHalfTable, kHalfTable, 0},
                     Vector3::UnitX(),
                     -Vector3::UnitY(),
                     2 * kHalfTable,
                     2 * kHalfTable,
                     table,
                     0.9});
    quads.push_back({{-kHalfRoom, kHalfRoom, kFloor},
                     Vector3::UnitX(),
                     -Vector3::UnitY(),
                     2 * kHalfRoom,
                     2 * kHalfRoom,
                     floor,
                     0.8});
    for (int side = 0; side < 4; ++side) {
      const SO3 turn = SO3::exp(Vector3(0, 0, 0.5 * std::numbers::pi * side));
      quads.push_back({turn * Vector3(-kHalfRoom, -kHalfRoom, kFloor + kHigh), turn * Vector3::UnitY(),
                       -Vector3::UnitZ(), 2 * kHalfRoom, kHigh, wall, 0.9});
    }
  }
};

/// A hand that holds the thing from below and turns with it, and, standing still, the table and a wall.
struct HoldingHand {
  int hand, table, wall;  ///< textures; of the hand the first of six

  void append(double t, std::vector<Quad>& quads) const {
    for (const Quad& quad : box_quads(SE3(SO3(), {0.01, 0, -0.5 * kHand.z()}), kHand, hand))
      quads.push_back(quad);
    const SE3 T_o_r = held(t).inverse();
    const SO3& turn = T_o_r.so3();
    quads.push_back({T_o_r * Vector3(-0.9, 1.0, -0.35), turn * Vector3::UnitX(),
                     turn * Vector3(-Vector3::UnitY()), 1.2, 2.0, table, 0.9});
    quads.push_back({T_o_r * Vector3(-0.9, -1.0, 0.85), turn * Vector3::UnitY(),
                     turn * Vector3(-Vector3::UnitZ()), 2.0, 1.2, wall, 0.9});
  }
  static inline const Vector3 kHand{0.05, 0.04, 0.06};
};

int painted(Scene& scene, double width, double height, Random& random, float grey) {
  Canvas canvas(width, height, 0.001, grey);
  paint_plaster(canvas, random, grey);
  scatter_specks(canvas, random, 1500, 0.002, 0.009, 50);
  return scene.add(canvas.finish());
}

void stage_turning_plate(Staging& staging, Random& random) {
  TurningPlate place{};
  place.plate = painted(staging.scene, kPlate, kPlate, random, 150);
  place.table = painted(staging.scene, 1.3, 1.6, random, 120);
  place.wall = painted(staging.scene, 1.6, 0.92, random, 170);
  staging.path = around;
  staging.round_seconds = kTurntableRound;
  staging.surroundings = [place](double t, std::vector<Quad>& quads) { place.append(t, quads); };
}

void stage_standing_room(Staging& staging, Random& random) {
  StandingRoom place{};
  place.table = painted(staging.scene, 1, 1, random, 150);
  place.floor = painted(staging.scene, 4, 4, random, 120);
  place.wall = painted(staging.scene, 4, 2.4, random, 170);
  staging.path = carried_around;
  staging.round_seconds = kCarriedRound;
  staging.surroundings = [place](double, std::vector<Quad>& quads) { place.append(quads); };
}

void stage_holding_hand(Staging& staging, Random& random) {
  HoldingHand place{};
  place.hand = add_box_textures(staging.scene, HoldingHand::kHand, kTurntableTexel, [&](Canvas& c) {
    paint_plaster(c, random, 190);
    scatter_specks(c, random, 4000, 0.001, 0.004, 30);
  });
  place.table = painted(staging.scene, 1.2, 2, random, 120);
  place.wall = painted(staging.scene, 2, 1.2, random, 170);
  staging.path = [](double t) { return held(t).inverse() * around(0); };
  staging.round_seconds = kTurntableRound;
  staging.surroundings = [place](double t, std::vector<Quad>& quads) { place.append(t, quads); };
}

}  // namespace

Staging make_turntable(std::uint64_t seed, const TurntableOptions& options) {
  using Stage = void (*)(Staging&, Random&);
  constexpr std::array<Stage, kTurntableMotions> kStages{stage_turning_plate, stage_standing_room,
                                                         stage_holding_hand};
  Staging staging;
  Random random(mix64(seed) ^ 0x7475726eULL);
  add_object(staging.scene, random, options.shape, options.texture);
  kStages[static_cast<std::size_t>(options.motion)](staging, random);
  return staging;
}

}  // namespace twofold::synthetic
