#pragma once

#include <string>
#include <vector>

#include "estimation/sliding_window_filter.hpp"

namespace twofold::bench {

/// The "Starry Night" recording (University of Toronto, Barfoot): a stereo camera moved by hand over 20
/// lights, with motion-capture truth, measured velocities and stated variances.
struct StarryNight {
  Rig rig;
  SE3 T_c_v;                       ///< vehicle to left camera
  std::vector<double> t;           ///< [s]
  std::vector<SE3> T_v_i;          ///< true vehicle poses (inertial to vehicle)
  std::vector<Vector3> landmarks;  ///< surveyed, inertial frame; used for evaluation only
  std::vector<WindowFrame> frames;
};

/// Reads states.txt, observations.txt, landmarks.txt, camera.txt of the folder; throws std::runtime_error
/// naming the file that is missing or broken.
///
/// The four-component measurement (u_l, v_l, u_r, v_r) of a rectified pair has v_l and v_r predicted alike;
/// their inverse-variance mean is a sufficient statistic if their errors are independent, as the stated
/// variances say.
[[nodiscard]] StarryNight load_starry_night(const std::string& folder, int steps);

}  // namespace twofold::bench
