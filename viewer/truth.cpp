#include "viewer/truth.hpp"

#include <algorithm>

namespace twofold {

ViewTruth truth_beside(const TrackedPose& tracked, std::span<const Pose> truth,
                       std::span<const std::int64_t> t_ns) {
  constexpr std::size_t kMost = 4096;
  auto nearest = std::lower_bound(t_ns.begin(), t_ns.end(), tracked.t_ns);
  const bool before_is_nearer =
      nearest != t_ns.begin() &&
      (nearest == t_ns.end() || tracked.t_ns - *std::prev(nearest) < *nearest - tracked.t_ns);
  if (before_is_nearer) --nearest;
  const Pose T_world_truth = compose(tracked.T_world_camera, inverse(truth[nearest - t_ns.begin()]));
  ViewTruth shown{tracked.part, {}};
  for (std::size_t i = 0; i < truth.size(); i += truth.size() / kMost + 1) {
    const auto p = transform(T_world_truth, truth[i].t);
    const double t = 1e-9 * static_cast<double>(t_ns[i] - tracked.t_ns);
    shown.path.push_back({float(t), float(p[0]), float(p[1]), float(p[2])});
  }
  return shown;
}

}  // namespace twofold
