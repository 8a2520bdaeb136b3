#pragma once

#include <algorithm>
#include <cmath>
#include <numbers>
#include <random>
#include <vector>

#include "estimation/robust_kernel.hpp"
#include "estimation/window_problem.hpp"
#include "geometry/inverse_depth.hpp"

namespace twofold {

/// A camera rides along a circle, looking outwards at points on all sides of it, and after a lap meets them
/// again. The inner window are the keyframes nearest to the middle one of the ride, in space: so it holds
/// frames of several laps.
struct SyntheticWindowOptions {
  int inner = 8;
  int outer = 0;
  double laps = 0.2;               ///< length of the ride over the circumference
  double spacing = 0.25;           ///< between keyframes [m]
  int points_per_keyframe = 40;    ///< landmarks in the world for each keyframe of the ride
  int max_track = 12;              ///< observations of a point at most
  bool outer_observations = true;  ///< keyframes of the outer window observe points, too
  bool constrain_all = false;      ///< pose-pose constraints also inside of the inner window
  SensorKind kind = SensorKind::kStereo;
  double missing_right = 0;      ///< share of the observations without u_r, in [0, 1]
  double pixel_noise = 0;        ///< [px]
  double outliers = 0;           ///< share of wildly wrong observations, in [0, 1]
  double constraint_noise = 0;   ///< [m], and a third of it in [rad]
  double start_pose_noise = 0;   ///< of the start values: [m], and a third of it in [rad]
  double start_depth_noise = 0;  ///< of the start values: relative, on inverse depth
  unsigned seed = 1;
};

struct SyntheticWindow {
  WindowProblem truth;  ///< true poses and points, noisy measurements
  WindowProblem start;  ///< the same with noisy start values
};

namespace synthetic_window_detail {

inline Rig make_rig(SensorKind kind) {
  Rig rig;
  rig.kind = kind;
  rig.camera = {420, 425, 319.5, 239.5, 640, 480};
  rig.baseline = kind == SensorKind::kMono ? 0 : 0.12;
  return rig;
}

inline SE3 pose_on_circle(double angle, double radius) {
  // z forward is radially outwards, turned a quarter right angle towards the direction of travel; y is down.
  const double heading = angle + 0.4;
  const Vector3 z(std::cos(heading), std::sin(heading), 0), y(0, 0, -1), x = y.cross(z);
  Matrix3 R_w_c;
  R_w_c << x, y, z;
  const Vector3 centre(radius * std::cos(angle), radius * std::sin(angle), 0.3 * std::sin(3 * angle));
  return SE3(R_w_c, centre).inverse();
}

template <class Rng>
Vector6 noise6(Rng& rng, double metres) {
  std::normal_distribution<double> normal;
  Vector6 v;
  for (int n = 0; n < 6; ++n) v[n] = normal(rng) * (n < 3 ? metres : metres / 3);
  return v;
}

}  // namespace synthetic_window_detail

inline SyntheticWindow make_synthetic_window(const SyntheticWindowOptions& options) {
  using namespace synthetic_window_detail;
  std::mt19937 rng(options.seed);
  std::uniform_real_distribution<double> uniform(0, 1);
  std::normal_distribution<double> normal;
  SyntheticWindow window;
  WindowProblem& problem = window.truth;
  problem.rig = make_rig(options.kind);

  const int count = options.inner + options.outer;
  const double radius = count * options.spacing / (2 * std::numbers::pi * options.laps);
  std::vector<SE3> ride;
  for (int i = 0; i < count; ++i) {
    ride.push_back(pose_on_circle(2 * std::numbers::pi * options.laps * i / count, radius));
  }
  std::vector<int> by_distance(count);
  for (int i = 0; i < count; ++i) by_distance[i] = i;
  const auto centre = [&](int i) { return ride[i].inverse().translation(); };
  std::stable_sort(by_distance.begin(), by_distance.end(), [&](int a, int b) {
    return (centre(a) - centre(count / 2)).norm() < (centre(b) - centre(count / 2)).norm();
  });
  std::vector<char> is_inner(count, 0);
  for (int n = 0; n < options.inner; ++n) is_inner[by_distance[n]] = 1;
  for (const SE3& T : ride) problem.poses.push_back({T, false});

  // Landmarks around the part of the circle that was ridden.
  for (int n = 0; n < options.points_per_keyframe * count; ++n) {
    const double angle = 2 * std::numbers::pi * (std::min(1.0, options.laps) * uniform(rng)) + 0.3;
    const double distance = radius + 1.5 + 6 * uniform(rng);
    const Vector3 p_w(distance * std::cos(angle), distance * std::sin(angle), 3 * uniform(rng) - 1.5);
    std::vector<int> seen_by;
    for (int i = 0; i < count; ++i) {
      const Vector3 x = ride[i] * p_w;
      if (x.z() > 0.8 && x.z() < 10 && problem.rig.camera.contains(problem.rig.camera.project(x))) {
        seen_by.push_back(i);
      }
    }
    std::shuffle(seen_by.begin(), seen_by.end(), rng);
    const int track = 3 + static_cast<int>((options.max_track - 2) * uniform(rng));
    if (static_cast<int>(seen_by.size()) > track) seen_by.resize(track);
    std::sort(seen_by.begin(), seen_by.end());
    const auto inner_count =
        std::count_if(seen_by.begin(), seen_by.end(), [&](int i) { return is_inner[i]; });
    if (inner_count < 2 || seen_by.size() < 3) continue;
    WindowProblem::Point point;
    point.anchor = seen_by.front();
    point.psi = to_inverse_depth(ride[point.anchor] * p_w);
    point.first_observation = static_cast<int>(problem.observations.size());
    for (const int i : seen_by) {
      if (!is_inner[i] && !options.outer_observations && i != point.anchor) continue;
      WindowProblem::Observation o;
      o.pose = i;
      Vector3 z = problem.rig.project(ride[i] * p_w);
      for (int c = 0; c < 3; ++c) z[c] += options.pixel_noise * normal(rng);
      if (uniform(rng) < options.outliers) {  // a wrong match: off in both images alike
        const double du = 60 * uniform(rng) - 30, dv = 60 * uniform(rng) - 30;
        z += Vector3(du, dv, du);
      }
      o.z = z.cast<float>();
      if (options.kind == SensorKind::kMono || uniform(rng) < options.missing_right) {
        o.information.z() = 0;
        o.z.z() = static_cast<float>(Rig::kNoRight);
      }
      problem.observations.push_back(o);
      ++point.observation_count;
    }
    problem.points.push_back(point);
  }
  for (int i = 0; i < count; ++i) {
    for (int j = i + 1; j < count; ++j) {
      const bool near = j == i + 1 || (centre(i) - centre(j)).norm() < 3.5 * options.spacing;
      if (!near || (is_inner[i] && is_inner[j] && !options.constrain_all)) continue;
      WindowProblem::PoseConstraint c;
      c.i = i, c.j = j;
      c.T_j_i = SE3::exp(noise6(rng, options.constraint_noise)) * ride[j] * ride[i].inverse();
      Matrix6 A = Matrix6::Identity();
      for (int n = 0; n < 36; ++n) A(n / 6, n % 6) += 0.1 * normal(rng);
      Vector6 sigma;
      sigma << 0.02, 0.02, 0.02, 0.007, 0.007, 0.007;
      const Matrix6 W = A * sigma.cwiseInverse().asDiagonal();
      c.information = W.transpose() * W;
      problem.constraints.push_back(c);
    }
  }

  window.start = window.truth;
  for (auto& pose : window.start.poses) {
    pose.T_k_w = SE3::exp(noise6(rng, options.start_pose_noise)) * pose.T_k_w;
  }
  for (auto& point : window.start.points) {
    point.psi.z() *= std::max(0.2, 1 + options.start_depth_noise * normal(rng));
  }
  return window;
}

}  // namespace twofold
