#pragma once

#include <vector>

#include "camera/rig.hpp"
#include "geometry/se3.hpp"

namespace twofold::bench {

/// A camera's true way past point landmarks  [m].
struct Scene {
  Rig rig;                 ///< monocular
  std::vector<SE3> T_c_w;  ///< true poses, in time
  std::vector<Vector3> points;
  double max_depth = 0;  ///< points further along the optical axis are hidden
};

/// Thesis fig. 5.5: a circle, the camera looking outwards onto a ring of points one metre further out. The
/// first and the last of 72 `radius` poses are neighbours. 500 `radius` points, +-0.4 m in radius and height.
[[nodiscard]] Scene circle_scene(double radius, unsigned seed);

/// Thesis fig. 5.6: an aircraft with a camera looking down, 2.5 m above a sphere with relief of +-0.3 m. The
/// flight winds from one pole towards the other in `turns` turns, each of which overlaps with its neighbours.
/// @throws std::runtime_error  when that many turns do not fit between the poles
[[nodiscard]] Scene sphere_scene(double radius, int turns, unsigned seed);

/// What one frame sees of a point: its index and its pixel.
struct Sighting {
  int point = 0;
  Vector2 uv{0, 0};
};

/// All sightings, frame by frame, points ascending; Gaussian noise of `sigma_px` in u and v.
[[nodiscard]] std::vector<std::vector<Sighting>> measure(const Scene& scene, double sigma_px, unsigned seed);

}  // namespace twofold::bench
