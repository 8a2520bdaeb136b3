#pragma once

#include <cstddef>
#include <string>

#include "camera/rig.hpp"

namespace twofold {

/// How depth images become a surface.
struct SurfaceOptions {
  double voxel = 0.01;      ///< distance of two samples of the signed distance [m], in [1e-4, 10]
  double truncation = 4;    ///< distances are kept up to so many voxels, in [2, 20], or three standard
                            ///< deviations of the reading, whichever is more, but no more than
                            ///< kMostDistanceVoxels
  double max_depth = 0;     ///< readings farther than this begin no surface [m] >= 0; 0: only Rig::depth_max
  double depth_noise = 0;   ///< standard deviation of a depth z is depth_noise z^2 [1/m],
                            ///< in [0, kMostDepthNoise]; 0: the sensor's
  double min_weight = 0.2;  ///< of a sample that the mesh rests on, > 0; at 1, one voxel is its standard
                            ///< deviation
  double max_weight = 100;  ///< weights end here, so that what has changed is learnt anew, >= 1
  int min_triangles = 60;   ///< smaller pieces of the mesh are left out, >= 0: specks of noise

  /// Empty when valid; otherwise names the field, the rule and the value.
  [[nodiscard]] std::string invalid_reason() const;
};

/// SurfaceOptions::depth_noise of a sensor [1/m]. RGB-D: a structured-light
/// camera's (Khoshelham and Oude Elberink, Sensors 2012); stereo: 0.12 px of disparity, as stereo_depth has
/// it.
[[nodiscard]] double usual_depth_noise(const Rig& rig);

/// Empty, or why a sensor's depth makes no surface: words that follow its name.
[[nodiscard]] std::string no_surface_reason(const Rig& rig);

}  // namespace twofold
