#pragma once

#include <vector>

#include "estimation/window_problem.hpp"
#include "mapping/double_window.hpp"

namespace twofold::bench {

/// The map's own unit of length, for rigs that measure disparities.
///
/// The disparities of a few keyframes measure the scale poorly. A pose-pose edge freezes the scale of the
/// window it was made in, and hundreds of edges made in one window share its error; eq. 6.4 takes them for
/// independent measurements, so that the disparities measured later cannot correct it.
///
/// With this class all lengths, in W1 as in the edges, are in the map's own unit, and the baseline in that
/// unit is estimated beside eq. 6.4 from the disparities of all keyframes, each counted once: the least
/// squares solution of z_kp = baseline d_kp over all points p of all keyframes k, with z the measured
/// disparity [px] and d = f / depth [px / unit], depths as the map has them. A keyframe's sums are renewed as
/// long as it is in W1.
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

}  // namespace twofold::bench
