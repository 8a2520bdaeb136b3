#pragma once

#include <vector>

#include "camera/measurement.hpp"
#include "camera/rig.hpp"
#include "geometry/se3.hpp"

namespace twofold::bench {

/// What of the simulation the thesis leaves open  (6.5.1: only the camera, the noise and the number of
/// keyframes are printed).
struct SceneOptions {
  double noise_px = 1;      ///< standard deviation of each coordinate of a measurement
  int max_sightings = 120;  ///< of a keyframe
  double density = 25;      ///< points per square metre of ground
  double height = 1.2;      ///< of the camera above the ground it looks down on [m]
  double step = 0.2;        ///< between keyframes [m]
  double spacing = 0.8;     ///< between the turns of the spiral [m]
  int min_covisible = 15;   ///< points seen from both keyframes that make an edge of eq. 6.10
};

/// One trial: true poses and points, and all measurements, drawn once so that every method gets the same.
struct Scene {
  struct Sighting {
    int point = 0;               ///< in `points`
    StereoPixel pixel{0, 0, 0};  ///< noise included
  };
  Rig rig;
  std::vector<SE3> T_k_w;                   ///< truth
  std::vector<Vector3> points;              ///< truth, world frame [m]
  std::vector<std::vector<Sighting>> seen;  ///< by keyframe, ascending by point
  std::vector<std::vector<int>>
      covisible;  ///< by keyframe: earlier ones that share min_covisible points with it

  [[nodiscard]] int keyframes() const { return static_cast<int>(T_k_w.size()); }
  [[nodiscard]] double median_depth(int keyframe) const;
};

/// Spiral from the centre outwards: loopy and exploring at the same time  (fig. 6.9).
[[nodiscard]] Scene spiral_scene(const SceneOptions& options, SensorKind kind, int keyframes, unsigned seed);
/// Twice around a large loop  (fig. 6.11), of which the thesis prints that its end is met after 150
/// keyframes: the circle on which its single camera drifts in section 5.4 (radius 10 m, looking outwards onto
/// a ring of 5000 points one metre further out), 150 of the 720 poses. Other numbers of keyframes are as far
/// apart. Of the options only noise, sightings and min_covisible are used.
[[nodiscard]] Scene double_loop_scene(const SceneOptions& options, int keyframes, unsigned seed);

}  // namespace twofold::bench
