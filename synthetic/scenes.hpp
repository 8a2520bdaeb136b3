#pragma once

#include <functional>
#include <vector>

#include "synthetic/camera_path.hpp"
#include "synthetic/scene.hpp"
#include "synthetic/walkers.hpp"

namespace twofold::synthetic {

/// A place and the way a camera takes through it.
struct Staging {
  Scene scene;
  CameraPath path;
  double round_seconds = 0;  ///< once around, back and forth, or down
  double walking_speed = 0;  ///< of who walks there [m/s]; 0: nobody does
  Walkers walkers;
  /// Where a moving box stands at time t [s], and its size; six textures from object_texture.
  std::function<SE3(double t)> T_w_object;
  Vector3 object_size = Vector3::Zero();
  int object_texture = 0;
  /// What is there at time t [s] beside the scene, and no part of its true surface; nothing when empty.
  std::function<void(double t, std::vector<Quad>& quads)> surroundings;
};

inline constexpr int kTurntableShapes = 2;    ///< a carton, a jar with a round lid
inline constexpr int kTurntableTextures = 3;  ///< prints, wood, stone
/// The plate turns, the camera is carried around, the thing is held and turned by hand.
inline constexpr int kTurntableMotions = 3;

struct TurntableOptions {
  int shape = 0, texture = 0, motion = 0;  ///< each below its number
};

/// seed changes every texture and small things in the layout; the walls, the path and its length stay.
/// plain: share of the walls' panels without texture.
[[nodiscard]] Staging make_courtyard(std::uint64_t seed,
                                     double plain = 0);  ///< 40 m loop between walls, columns and trees
[[nodiscard]] Staging make_desk(std::uint64_t seed);     ///< things on a desk, looked along from 0.7 m
[[nodiscard]] Staging make_corridor(std::uint64_t seed,
                                    double plain = 0);    ///< up and down a corridor of 24 m
[[nodiscard]] Staging make_cloister(std::uint64_t seed);  ///< sideways round a square of 16 m
[[nodiscard]] Staging make_campus(std::uint64_t seed);    ///< a quadrangle and two large loops, 1.7 km
[[nodiscard]] Staging make_terrace(std::uint64_t seed);   ///< 3 km along houses that are copies of four
[[nodiscard]] Staging make_descent(
    std::uint64_t seed);  ///< straight down onto a cratered surface, 10 m to 1 m
/// Straight down onto ground that has detail of every size, 200 m to 20 cm.
[[nodiscard]] Staging make_landing(std::uint64_t seed);
/// A thing of 15 cm before a camera, and what is around it; the world is the thing's. It stands on a plate
/// that turns while camera, table and wall stand still; or nothing moves but the camera, carried around it by
/// hand; or a hand holds it from below and turns it before a camera that stands still.
[[nodiscard]] Staging make_turntable(std::uint64_t seed, const TurntableOptions& options);

}  // namespace twofold::synthetic
