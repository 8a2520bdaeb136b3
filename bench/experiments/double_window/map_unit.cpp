#include "experiments/double_window/map_unit.hpp"

#include <algorithm>

#include "camera/measurement.hpp"
#include "geometry/inverse_depth.hpp"

namespace twofold::bench {

MapUnit::Sums& MapUnit::Sums::operator+=(const Sums& other) {
  dz += other.dz;
  dd += other.dd;
  return *this;
}

MapUnit::Sums& MapUnit::Sums::operator-=(const Sums& other) {
  dz -= other.dz;
  dd -= other.dd;
  return *this;
}

double MapUnit::baseline(const Sums& sums, const Rig& rig) {
  return sums.dd > 0 && sums.dz > 0 ? sums.dz / sums.dd : rig.baseline;
}

void MapUnit::read(const WindowProblem& problem, const DoubleWindow& window) {
  read_.assign(window.inner, {});
  for (const auto& point : problem.points) {
    const SE3& T_a_w = problem.poses[static_cast<std::size_t>(point.anchor)].T_k_w;
    const Vector3 x_w = T_a_w.inverse() * from_inverse_depth(point.psi);
    for (int n = 0; n < point.observation_count; ++n) {
      const auto& seen = problem.observations[static_cast<std::size_t>(point.first_observation + n)];
      if (!window.is_inner(seen.pose) || !weighs_right(seen.information)) continue;
      const auto k = static_cast<std::size_t>(seen.pose);
      const double depth = (problem.poses[k].T_k_w * x_w).z();
      if (depth <= 0) continue;
      const double variance = 1.0 / seen.information.x() + 1.0 / seen.information.z();
      const double d = problem.rig.camera.fx / depth, z = seen.pixel.x() - seen.pixel.z();
      read_[k] += {d * z / variance, d * d / variance};
    }
  }
  window_ = {};
  for (std::size_t n = 0; n < window.inner; ++n) {
    const std::size_t k = index(window.nodes[n].id);
    if (k >= by_keyframe_.size()) by_keyframe_.resize(k + 1);
    map_ -= by_keyframe_[k];
    by_keyframe_[k] = read_[n];
    map_ += by_keyframe_[k];
    window_ += by_keyframe_[k];
  }
}

}  // namespace twofold::bench
