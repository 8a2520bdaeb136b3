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

struct SphereOptions {
  double radius = 10;    ///< of the ground [m]
  double relief = 0.3;   ///< ground points lie within radius +- relief [m]
  double height = 5;     ///< of the flight above the ground [m]
  int turns = 11;        ///< around the axis, from near one pole to near the other
  double spacing = 3.5;  ///< between turns [m], so that each overlaps with its neighbours
  double step = 0.3;     ///< between frames [m]
  double density = 4;    ///< ground points a square metre
};

/// Thesis fig. 5.6: an aircraft with a camera looking down winds around a sphere, the long side of the image
/// across the flight.
/// @throws std::runtime_error  when that many turns do not fit between the poles
[[nodiscard]] Scene sphere_scene(const SphereOptions& options, unsigned seed);

/// What one frame sees of a point: its index and its pixel.
struct Sighting {
  int point = 0;
  Vector2 uv{0, 0};
};

/// All sightings, frame by frame, points ascending; Gaussian noise of `sigma_px` in u and v.
[[nodiscard]] std::vector<std::vector<Sighting>> measure(const Scene& scene, double sigma_px, unsigned seed);

}  // namespace twofold::bench
