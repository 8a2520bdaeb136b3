#pragma once

#include <vector>

#include "estimation/window_problem.hpp"
#include "mapping/double_window.hpp"

namespace twofold {

/// The map's own unit of length, for rigs that measure disparities.
///
/// What a few keyframes' disparities say about scale is poor, and pose-pose edges cannot tell it from what
/// points say about shape: hundreds of them repeat, each as if it knew it by itself, the one error they have
/// in common, the scale of the windows they were made in, and hold it against all that is measured later.
/// So lengths of the map, in W1 as in the edges, are in a unit that the edges carry on, and one number, the
/// baseline in that unit, is estimated beside eq. 6.4 from the disparities of all keyframes, each counted
/// once: least squares of z_kp = baseline d_kp, structure given, with d = f / depth [px / unit] and z the
/// measured disparity of point p in keyframe k. A keyframe is read anew as long as it is in W1.
///
/// One unit for the whole map: its scale must drift by less than the disparities of a window can tell. Holds
/// where paths keep crossing; a long exploration would have to forget.
class MapUnit {
 public:
  /// Reads the disparities of W1's keyframes, in place of what they said before.
  void read(const WindowProblem& problem, const DoubleWindow& window);

  /// By the disparities of W1 alone, and of all keyframes [units]; the rig's own before anything was read.
  [[nodiscard]] double window_baseline(const Rig& rig) const { return baseline(window_, rig); }
  [[nodiscard]] double map_baseline(const Rig& rig) const { return baseline(map_, rig); }

 private:
  struct Sums {
    double dz = 0, dd = 0;  ///< whitened
    Sums& operator+=(const Sums& other);
    Sums& operator-=(const Sums& other);
  };
  [[nodiscard]] static double baseline(const Sums& sums, const Rig& rig);

  std::vector<Sums> by_keyframe_;
  std::vector<Sums> read_;  ///< scratch: by node of W1
  Sums window_, map_;
};

}  // namespace twofold
