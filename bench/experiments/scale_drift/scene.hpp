#pragma once

#include <vector>

#include "camera/rig.hpp"
#include "geometry/se3.hpp"

namespace twofold::bench {

/// A camera's true way past points  [m].
struct Scene {
  Rig rig;                 ///< monocular
  std::vector<SE3> T_c_w;  ///< true poses, in time
  std::vector<Vector3> points;
  double max_depth = 0;  ///< points further along the optical axis are hidden
};

/// Thesis fig. 5.5: a circle, the camera looking outwards onto a ring of points one metre further out. The
/// first and the last of 72 `radius` poses are neighbours. 500 `radius` points, +-1 m in height.
[[nodiscard]] Scene circle_scene(double radius, unsigned seed);

struct SphereOptions {
  double radius = 10;   ///< of the ground [m]
  double height = 1;    ///< of the flight above the ground [m]
  double step = 0.3;    ///< between frames [m]
  double density = 12;  ///< ground points a square metre
};

/// Thesis fig. 5.6: an aircraft with a camera looking down flies over a sphere, four times from one place on
/// the equator out and back to it, first north, then south: two turns climbing to a latitude of 32 degrees,
/// then one turn to 58 degrees. The thesis prints none of this: way, height, steps and points (their angle
/// from the nearer pole is sqrt(pi u), u uniform) are those of its author's program.
[[nodiscard]] Scene sphere_scene(const SphereOptions& options, unsigned seed);

/// What one frame sees of a point: its index and its pixel.
struct Sighting {
  int point = 0;
  Vector2 uv{0, 0};
};

/// All sightings, frame by frame, points ascending; Gaussian noise of `sigma_px` in u and v.
[[nodiscard]] std::vector<std::vector<Sighting>> measure(const Scene& scene, double sigma_px, unsigned seed);

}  // namespace twofold::bench
