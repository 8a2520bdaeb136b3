#include "synthetic/walkers.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <utility>

#include "synthetic/furniture.hpp"
#include "synthetic/materials.hpp"
#include "synthetic/wall_fixtures.hpp"

namespace twofold::synthetic {
namespace {

constexpr double kFirstTurn = 3;   ///< [s]
constexpr double kNextTurn = 5;    ///< until the next one's [s]
constexpr double kFar = 10;        ///< from where they come, and to where they go [m]
constexpr double kApproach = 3.5;  ///< for so long they come or go [s]
constexpr double kPassAside = 0.55;
constexpr double kWalkerTexel = 0.004;
constexpr double kStride = 1.4;  ///< two steps [m]

/// A part of the body: a box, its centre while standing (x: ahead, y: left, z: up), and how it swings.
struct BodyPart {
  Vector3 size;  ///< depth, breadth, height [m]
  Vector3 centre;
  double swing;  ///< about its upper end, [rad] to either side
};
constexpr int kParts = 6;
const std::array<BodyPart, kParts>& body() {
  static const std::array<BodyPart, kParts> kBody{{{{0.26, 0.44, 0.62}, {0, 0, 1.13}, 0},
                                                   {{0.22, 0.19, 0.25}, {0, 0, 1.6}, 0},
                                                   {{0.17, 0.16, 0.84}, {0, 0.11, 0.42}, 0.45},
                                                   {{0.17, 0.16, 0.84}, {0, -0.11, 0.42}, -0.45},
                                                   {{0.13, 0.11, 0.62}, {0, 0.29, 1.11}, -0.4},
                                                   {{0.13, 0.11, 0.62}, {0, -0.29, 1.11}, 0.4}}};
  return kBody;
}

/// 0 to 1 and level at both ends.
double ease(double x) {
  x = std::clamp(x, 0.0, 1.0);
  return x * x * (3 - 2 * x);
}

void paint_clothes(Canvas& canvas, Random& random, float grey) {
  paint_plaster(canvas, random, grey);
  for (double y = random.uniform(0, 0.1); y < canvas.height(); y += random.uniform(0.05, 0.15)) {
    const float tone = vary(random, grey, 70);
    canvas.rectangle(0, y, canvas.width(), random.uniform(0.01, 0.05), tone);
  }
  scatter_specks(canvas, random, 300, 0.006, 0.03, 60);
}

}  // namespace

Walkers::Walkers(Scene& scene, CameraPath path, double speed, int count, std::uint64_t seed)
    : path_(std::move(path)), speed_(speed) {
  for (int i = 0; i < count; ++i) {
    Random random(mix64(seed ^ 0x77616c6bULL) + static_cast<std::uint64_t>(i));
    first_textures_.push_back(static_cast<int>(scene.textures.size()));
    for (const BodyPart& part : body()) {
      const auto grey = static_cast<float>(random.uniform(70, 190));
      add_box_textures(scene, part.size, kWalkerTexel, [&](Canvas& c) { paint_clothes(c, random, grey); });
    }
  }
}

/// Comes from afar, keeps its distance, and hurries on.
Walkers::Place Walkers::ahead(double since) const {
  const double gone = std::max(since - kApproach - kAheadSeconds, 0.0) / kApproach;
  const double away = (1 - ease(since / kApproach)) + ease(gone);
  const double metres = kAhead + (kFar - kAhead) * away;
  return {metres / speed_, 0.25 * std::sin(0.8 * since), false, since >= 0 && gone < 1};
}

/// Walks the other way, as fast as the camera.
Walkers::Place Walkers::coming(double since) const {
  const double metres = kFar - 2 * speed_ * since;
  return {metres / speed_, kPassAside, true, since >= 0 && metres > -1};
}

Walkers::Place Walkers::place(int walker, double t) const {
  const double cycle = kNextTurn * std::max(static_cast<double>(first_textures_.size()), 4.0);
  const double turn = t - kFirstTurn - kNextTurn * walker;
  if (turn < 0) return {};
  const double since = std::fmod(turn, cycle);
  return walker % 2 == 0 ? ahead(since) : coming(since);
}

void Walkers::append(double t, std::vector<Quad>& quads) const {
  constexpr double kGlimpse = 0.3;  // [s] between two places of the path that tell its direction
  for (std::size_t i = 0; i < first_textures_.size(); ++i) {
    const Place place = this->place(static_cast<int>(i), t);
    const double at = t + place.lead;
    if (!place.present || at < kGlimpse) continue;
    const Vector3 along = path_(at + kGlimpse).translation() - path_(at - kGlimpse).translation();
    const double heading = std::atan2(along.y(), along.x());
    const Vector3 camera = path_(at).translation();
    const double x = camera.x() - place.aside * std::sin(heading);
    const double y = camera.y() + place.aside * std::cos(heading);
    const double walked = place.towards ? -speed_ * at : speed_ * at;
    append_figure(standing(x, y, 0, place.towards ? heading + std::numbers::pi : heading),
                  2 * std::numbers::pi * walked / kStride, first_textures_[i], quads);
  }
}

void Walkers::append_figure(const SE3& T_w_feet, double step, int first_texture,
                            std::vector<Quad>& quads) const {
  for (const BodyPart& part : body()) {
    const double angle = part.swing * std::sin(step);
    const Vector3 hinge = part.centre + Vector3(0, 0, 0.5 * part.size.z());
    const SE3 T_feet_part = SE3(SO3(), hinge) * SE3(SO3::exp(Vector3(0, angle, 0)), Vector3::Zero()) *
                            SE3(SO3(), Vector3(0, 0, -0.5 * part.size.z()));
    for (const Quad& quad : box_quads(T_w_feet * T_feet_part, part.size, first_texture))
      quads.push_back(quad);
    first_texture += 6;
  }
}

}  // namespace twofold::synthetic
