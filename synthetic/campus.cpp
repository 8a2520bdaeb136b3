#include <cmath>
#include <numbers>

#include "synthetic/furniture.hpp"
#include "synthetic/materials.hpp"
#include "synthetic/scenes.hpp"
#include "synthetic/wall_fixtures.hpp"

namespace twofold::synthetic {
namespace {

constexpr double kSpeed = 2;           ///< [m/s]
constexpr double kCampusTexel = 0.03;  ///< of houses
constexpr double kSpacing = 5;         ///< of the way's control points [m]
constexpr double kAside = 7;           ///< of houses and trees from the way [m]
constexpr double kClear = 4.5;         ///< no corner of a house is nearer to any way [m]
constexpr double kHouse = 8;           ///< width of a house and its garden [m]
constexpr double kGround = 115;        ///< half width of the ground [m]

/// Along the corners, with control points kSpacing apart; the last corner is left to whoever goes on.
void go(std::vector<Vector2>& way, const std::vector<Vector2>& corners) {
  for (std::size_t c = 0; c + 1 < corners.size(); ++c) {
    const Vector2 leg = corners[c + 1] - corners[c];
    const int steps = std::max(1, static_cast<int>(std::lround(leg.norm() / kSpacing)));
    for (int i = 0; i < steps; ++i) way.emplace_back(corners[c] + leg * (static_cast<double>(i) / steps));
  }
}

/// Anticlockwise: the quadrangle three times; the large loop to the south, which comes back along its north
/// side; the quadrangle; the loop to the north, which comes back along its south side; the quadrangle.
std::vector<Vector2> whole_way() {
  const Vector2 sw(-18, -13), se(18, -13), ne(18, 13), nw(-18, 13);
  std::vector<Vector2> way;
  for (int round = 0; round < 3; ++round) go(way, {nw, sw, se, ne, nw});
  go(way, {nw, {-95, 13}, {-95, -95}, {95, -95}, {95, 13}, ne, nw});
  go(way, {nw, sw, se, ne, nw});
  go(way, {nw, sw, se, {80, -13}, {80, 100}, {-80, 100}, {-80, -13}, sw, se, ne, nw});
  return way;
}

double distance_to(const std::vector<Vector2>& way, const Vector2& p) {
  double nearest = 1e9;
  for (const Vector2& q : way) nearest = std::min(nearest, (p - q).norm());
  return nearest;
}

void add_house(Scene& scene, Random& random, const Vector2& at, double yaw) {
  const Vector3 size = random_size(random, {5, 2.5, 3.5}, {6.6, 4, 6.5});
  const int style = random.below(4);
  add_box(scene, standing(at.x(), at.y(), 0.5 * size.z(), yaw), size, kCampusTexel, [&](Canvas& c) {
    if (c.height() < 3.45) return;  // roof and floor
    paint_facade(c, random, style);
  });
}

void add_park_tree(Scene& scene, Random& random, const Vector2& at) {
  const double height = random.uniform(2.2, 3);
  add_cylinder(scene, {at.x(), at.y(), 0}, random.uniform(0.15, 0.25), height, 0.02,
               [&](Canvas& c) { paint_bark(c, random, 92); });
  const double radius = random.uniform(0.9, 1.4);
  add_ball(scene, {at.x(), at.y(), height + 0.6 * radius}, radius, 0.03,
           [&](Canvas& c) { paint_foliage(c, random, 0.12, 105); });
}

/// Houses, and trees before the gaps, on both sides of the way, where no part of it is near.
void line_the_way(Scene& scene, Random& random, const std::vector<Vector2>& way) {
  std::vector<Vector2> built;
  double since = kHouse;
  for (std::size_t i = 1; i < way.size(); ++i) {
    const Vector2 step = way[i] - way[i - 1];
    since += step.norm();
    if (since < kHouse || step.norm() < 0.5) continue;
    since = 0;
    const Vector2 left = Vector2(-step.y(), step.x()).normalized();
    for (const double side : {1.0, -1.0}) {
      const Vector2 at = way[i] + side * (kAside + random.uniform(0, 1.5)) * left;
      const bool room = distance_to(built, at) > 0.8 * kHouse;
      if (!room || distance_to(way, at) < kClear + 1.5) continue;
      built.push_back(at);
      const double yaw = std::atan2(step.y(), step.x());
      // The front of a box looks along its -y.
      add_house(scene, random, at, yaw + (side > 0 ? 0 : std::numbers::pi) + random.uniform(-0.1, 0.1));
      const Vector2 tree = way[i] + side * random.uniform(3.4, 4.2) * left + 4 * step.normalized();
      if (random.chance(0.5) && distance_to(way, tree) > 3) add_park_tree(scene, random, tree);
    }
  }
}

}  // namespace

/// Five rounds of a quadrangle and two loops of some 600 m through streets, 1.7 km in all, as in thesis
/// 6.5.2. One round of the staging is the whole way.
Staging make_campus(std::uint64_t seed) {
  Staging staging;
  Random random(mix64(seed) ^ 0x63616d707573ULL);
  const std::vector<Vector2> way = whole_way();
  line_the_way(staging.scene, random, way);
  Canvas ground(2 * kGround, 2 * kGround, 0.06, 125);
  ground.add_noise(random.word(), 40, 2.4, 0.12, 0.9f);
  scatter_specks(ground, random, 1.2, 0.07, 0.3, 60);
  staging.scene.quads.push_back({{-kGround, kGround, 0},
                                 Vector3::UnitX(),
                                 -Vector3::UnitY(),
                                 2 * kGround,
                                 2 * kGround,
                                 staging.scene.add(ground.finish()),
                                 0.95});
  const ClosedCurve curve(way);
  WalkStyle style;
  style.speed = kSpeed;
  style.look_aside_deg = 0;
  staging.path = walk(curve, style);
  staging.round_seconds = curve.length() / kSpeed;
  staging.object_size = {0.5, 0.35, 1.75};
  staging.object_texture = add_box_textures(staging.scene, staging.object_size, kCampusTexel,
                                            [&](Canvas& c) { paint_plaster(c, random, 110); });
  staging.T_w_object = [curve](double t) {
    const Vector2 p = curve.position(kSpeed * t + 8 + 3 * std::sin(0.2 * t));
    return standing(p.x(), p.y(), 0.875, 0.1 * t);
  };
  return staging;
}

}  // namespace twofold::synthetic
