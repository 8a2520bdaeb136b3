#include <array>
#include <cmath>
#include <numbers>

#include "synthetic/furniture.hpp"
#include "synthetic/materials.hpp"
#include "synthetic/scenes.hpp"

namespace twofold::synthetic {
namespace {

constexpr double kLandingTop = 200;       ///< height of the camera at first [m] ...
constexpr double kLandingBottom = 0.05;   ///< ... and at last
constexpr double kLandingSeconds = 10;    ///< between both, always by the same share of the height
constexpr double kLandingGround = 600;    ///< width of the ground [m]
constexpr double kLandingStep = 3;        ///< each tile is so many times as wide as the next one on it
constexpr int kLandingTiles = 8;          ///< the last one is 0.27 m wide
constexpr double kTexelsAcross = 1100;    ///< of each tile: a texel is never much larger than a pixel
constexpr int kBoxesAround = 40;          ///< on each tile, beyond the next one
constexpr double kTileThickness = 0.001;  ///< of a tile's width

/// A tile of the ground with boxes on it, houses on the widest and crumbs on the last, all beyond the middle
/// that the next tile covers.
void lay_tile(Scene& scene, Random& random, double width, double z) {
  Canvas ground(width, width, width / kTexelsAcross, 125);
  ground.add_noise(random.word(), 40, 0.15 * width, 3 * ground.texel(), 0.85f);
  const double per_square_metre = 900 / (width * width);
  scatter_specks(ground, random, per_square_metre, 0.004 * width, 0.02 * width, 50);
  scene.quads.push_back({{-0.5 * width, 0.5 * width, z},
                         Vector3::UnitX(),
                         -Vector3::UnitY(),
                         width,
                         width,
                         scene.add(ground.finish()),
                         0.95});
  for (int i = 0; i < kBoxesAround; ++i) {
    const Vector3 size = width * random_size(random, {0.02, 0.02, 0.01}, {0.06, 0.06, 0.05});
    const double radius = width * random.uniform(0.5 / kLandingStep * std::numbers::sqrt2 + 0.05, 0.48);
    const double angle = random.uniform(0, 2 * std::numbers::pi);
    const double yaw = random.uniform(0, 2 * std::numbers::pi);
    const auto grey = static_cast<float>(random.uniform(60, 210));
    add_box(scene, standing(radius * std::cos(angle), radius * std::sin(angle), z + 0.5 * size.z(), yaw),
            size, 2 * ground.texel(), [&](Canvas& c) {
              c.image().setTo(grey);
              c.add_noise(random.word(), 30, 0.02 * width, 4 * ground.texel(), 0.85f);
            });
  }
}

/// Straight down and up again, swaying by a few hundredths of the height.
SE3 landing_at(double t) {
  const double sinking = std::log(kLandingTop / kLandingBottom) / kLandingSeconds;
  const double phase = std::fmod(t, 2 * kLandingSeconds);
  const double sunk_for = kLandingSeconds - std::abs(kLandingSeconds - phase);
  const double height = kLandingTop * std::exp(-sinking * sunk_for);
  Matrix3 R_w_c;
  R_w_c << 1, 0, 0, 0, -1, 0, 0, 0, -1;
  const SO3 sway =
      SO3::exp(Vector3(0.02 * std::sin(1.1 * t), 0.025 * std::sin(0.8 * t), 0.1 * std::sin(0.4 * t)));
  return {SO3(R_w_c) * sway,
          Vector3(0.06 * height * std::sin(0.9 * t), 0.05 * height * std::sin(1.3 * t), height)};
}

}  // namespace

Staging make_landing(std::uint64_t seed) {
  Staging staging;
  Random random(mix64(seed) ^ 0x6c616e6465ULL);
  double width = kLandingGround, z = 0;
  for (int tile = 0; tile < kLandingTiles; ++tile, width /= kLandingStep) {
    lay_tile(staging.scene, random, width, z);
    z += kTileThickness * width / kLandingStep;
  }
  staging.path = [z](double t) { return SE3(SO3(), Vector3(0, 0, z)) * landing_at(t); };
  staging.round_seconds = kLandingSeconds;
  staging.object_size = {2, 1.5, 1.5};
  staging.object_texture = add_box_textures(staging.scene, staging.object_size, 0.02,
                                            [&](Canvas& c) { paint_metal(c, random, 150); });
  staging.T_w_object = [](double t) { return standing(3 * t - 15, 10, 1, 0.3); };
  return staging;
}

}  // namespace twofold::synthetic
