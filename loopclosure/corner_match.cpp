#include "loopclosure/corner_match.hpp"

#include "estimation/motion_only.hpp"

namespace twofold {

SE3 fit_pose_to_corners(const Rig& rig, const PlaceAppearance& b, const std::vector<CornerMatch>& matches,
                        const SE3& T_b_a) {
  std::vector<MotionObservation> observations;
  observations.reserve(matches.size());
  for (const CornerMatch& match : matches) {
    const StereoPixelF& z_b = b.pixels[static_cast<std::size_t>(match.b)];
    const int level = b.corners[static_cast<std::size_t>(match.b)].level;
    observations.push_back(observe_point(rig, match.x_a, z_b, level));
  }
  const MotionOnlyResult result = optimise_motion(rig, observations, T_b_a, {});
  return result.converged ? result.T_c_ref : T_b_a;
}

}  // namespace twofold
