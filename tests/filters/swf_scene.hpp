#pragma once

#include <random>
#include <vector>

#include "filters/sliding_window_filter.hpp"

namespace twofold::testing {

/// A stereo rig that descends sideways towards points spread over a slab; measured motion and pixels are
/// noisy.
struct SwfScene {
  Rig rig;
  std::vector<SE3> T_c_w;
  std::vector<Vector3> points;
  std::vector<FilterFrame> frames;
};

struct SwfSceneOptions {
  int frames = 8;
  int points = 40;
  unsigned seed = 1;
  double noise_px = 0.5;
  double motion_noise = 1;  ///< scale of the measured motions' noise
  bool motion = true;       ///< attach measured motions
  double step = 0.35;       ///< sideways per frame [m]
  double visible = 1e9;     ///< half width of the visible strip [m]
};

inline Vector6 random_vector6(std::mt19937& rng, double v, double omega) {
  std::normal_distribution<double> n(0, 1);
  Vector6 x;
  for (int i = 0; i < 6; ++i) x[i] = n(rng) * (i < 3 ? v : omega);
  return x;
}

inline SwfScene make_swf_scene(const SwfSceneOptions& options) {
  SwfScene scene;
  scene.rig.camera = {500, 500, 320, 240, 640, 480};
  scene.rig.baseline = 0.3;
  std::mt19937 rng(options.seed);
  std::normal_distribution<double> normal(0, 1);
  const double length = options.step * options.frames;
  std::uniform_real_distribution<double> x(-3, 3 + length), y(-2, 2), z(6, 9);
  for (int i = 0; i < options.points; ++i) scene.points.emplace_back(x(rng), y(rng), z(rng));
  Vector6 sigma;
  sigma << 0.02, 0.02, 0.02, 0.004, 0.004, 0.004;
  sigma *= options.motion_noise;
  for (int j = 0; j < options.frames; ++j) {
    Vector6 wobble = random_vector6(rng, 0.03, 0.01);
    const SE3 T_w_c(SO3::exp(Vector3(0.01 * j, -0.02 * j, 0.015 * j)),
                    Vector3(options.step * j, 0.02 * j, 0.1 * j));
    scene.T_c_w.push_back(j == 0 ? SE3() : SE3::exp(wobble) * T_w_c.inverse());
    FilterFrame frame;
    if (j > 0 && options.motion) {
      MotionInput input;
      input.covariance = sigma.cwiseAbs2().asDiagonal();
      const Vector6 w = random_vector6(rng, sigma[0], sigma[3]);
      input.T_cur_prev = SE3::exp(w) * scene.T_c_w[j] * scene.T_c_w[j - 1].inverse();
      frame.motion = input;
    }
    for (int i = 0; i < options.points; ++i) {
      const Vector3 x_c = scene.T_c_w.back() * scene.points[static_cast<std::size_t>(i)];
      if (x_c.z() < 1 || std::abs(x_c.x()) > options.visible) continue;
      LandmarkObservation o;
      o.landmark = i;
      o.pixel = scene.rig.project(x_c) + options.noise_px * Vector3(normal(rng), normal(rng), normal(rng));
      o.information = Matrix3::Identity() / std::max(1e-12, options.noise_px * options.noise_px);
      frame.observations.push_back(o);
    }
    scene.frames.push_back(std::move(frame));
  }
  return scene;
}

inline Matrix6 swf_first_information() {
  Vector6 sigma;
  sigma << 0.05, 0.05, 0.05, 0.01, 0.01, 0.01;
  return sigma.cwiseAbs2().cwiseInverse().asDiagonal();
}

/// Options for comparisons to many digits.
inline SlidingWindowOptions exact_options(int window) {
  SlidingWindowOptions options;
  options.window = window;
  options.robust = false;
  options.linearisation = Linearisation::kCurrent;
  options.keep_unseen_landmarks = true;
  options.max_iterations = 40;
  options.stop_decrement = 1e-22;
  return options;
}

}  // namespace twofold::testing
