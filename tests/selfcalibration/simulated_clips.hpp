#pragma once

#include <cmath>
#include <numbers>
#include <random>
#include <vector>

#include "selfcalibration/clip_adjustment.hpp"

namespace twofold::testing {

/// A camera of which clips are made up, and how it moves.
struct ClipWorld {
  SharedLens lens{
      .log_f = std::log(500.0), .k1 = 0, .k2 = 0, .centre = {319.5, 239.5}, .readout = 0, .height = 480};
  double noise_px = 0.2;
  double turn =
      0.25;  ///< of a clip, about an axis in the image plane and half as much about the optical one [rad]
  Vector3 way{0.1, 0.05,
              0.05};  ///< of a clip, in depths of the nearest corners; its first part may change sign
  int clips = 12;
  int corners = 60;
  int views = 8;
  unsigned seed = 1;
};

/// Corners from 1 to 5 depths away, spread over the image of the middle view.
[[nodiscard]] inline std::vector<Clip> simulate_clips(const ClipWorld& world) {
  std::mt19937 random(world.seed);
  std::normal_distribution<double> normal(0, world.noise_px);
  std::uniform_real_distribution<double> uniform(-1, 1);
  const double period = 0.1;  // [s] between views
  std::vector<Clip> clips;
  for (int c = 0; c < world.clips; ++c) {
    const double direction = std::numbers::pi * uniform(random);
    const Vector3 turn =
        world.turn * Vector3(std::cos(direction), std::sin(direction), 0.5 * uniform(random));
    Vector3 way = world.way;
    way.x() *= uniform(random);
    const auto pose = [&](double s) {  // s in [-0.5, 0.5]; T_view_middle
      return SE3(SO3::exp(s * turn), s * way);
    };
    const auto see = [&](const SE3& T, const Vector3& x) -> Vector2 {
      const Vector3 p = T * x;
      const Vector2 q = p.head<2>() / p.z();
      const double r2 = q.squaredNorm();
      return world.lens.f() * (1 + r2 * (world.lens.k1 + r2 * world.lens.k2)) * q + world.lens.centre;
    };
    std::vector<Vector3> points;
    for (int i = 0; i < world.corners; ++i) {
      const double depth = 3 + 2 * uniform(random);
      points.push_back(depth * Vector3(0.9 * uniform(random) * world.lens.centre.x() / world.lens.f(),
                                       0.9 * uniform(random) * world.lens.centre.y() / world.lens.f(), 1));
    }
    Clip clip;
    const double step = 1.0 / (world.views - 1);
    for (int k = 0; k < world.views; ++k) {
      ClipView view;
      view.t_ns = std::llround((c * world.views + k) * period * 1e9);
      for (const Vector3& x : points) {
        const double s = -0.5 + k * step;
        const Vector2 velocity =
            (see(pose(s + 0.1 * step), x) - see(pose(s - 0.1 * step), x)) / (0.2 * period);
        const Vector2 uv = see(pose(s), x);
        const double row = (uv.y() + 0.5) / world.lens.height - 0.5;
        view.uv.emplace_back(uv + row * world.lens.readout * velocity +
                             Vector2(normal(random), normal(random)));
        view.velocity.push_back(velocity);
      }
      clip.views.push_back(std::move(view));
    }
    clips.push_back(std::move(clip));
  }
  return clips;
}

}  // namespace twofold::testing
