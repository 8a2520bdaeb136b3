#pragma once

#include <string>
#include <vector>

#include "filters/sliding_window_filter.hpp"

namespace twofold::bench {

/// The "Starry Night" recording (University of Toronto, Barfoot): a stereo camera moved by hand over 20
/// lights, with motion-capture truth, measured velocities and stated variances.
struct StarryNight {
  Rig rig;
  SE3 T_c_v;                       ///< vehicle to left camera
  std::vector<double> t;           ///< [s]
  std::vector<SE3> T_v_i;          ///< true vehicle poses (inertial to vehicle)
  std::vector<Vector3> landmarks;  ///< surveyed, inertial frame; used for evaluation only
  std::vector<FilterFrame> frames;
};

/// Reads states.txt, observations.txt, landmarks.txt, camera.txt of the folder from step `first` on; throws
/// std::runtime_error naming the file that is missing or broken.
///
/// The rows v_l and v_r of the rectified pair become one measurement, their mean, with the mean of their
/// stated variances: against the truth their errors are equal to within a pixel (the mean has 130 px^2, as
/// each alone), so that counting both would claim information that is not there.
[[nodiscard]] StarryNight load_starry_night(const std::string& folder, int first, int steps);

}  // namespace twofold::bench
