#pragma once

#include <functional>
#include <vector>

#include "experiments/double_window/scene.hpp"
#include "graph/snapshot.hpp"

namespace twofold::bench {

/// How even the scale of a map is from place to place: squared changes of the mean of ln(estimated / true
/// length) from ten steps between keyframes to the next ten. A scale that all share does not count, a drift
/// does by what it does in that distance.
struct ScaleChange {
  double squares = 0;
  int pairs = 0;

  void add(const ScaleChange& other);
  [[nodiscard]] double rms() const;  ///< 0.01 being one percent of length
};

/// ln(estimated / true length) of the step from keyframe k - 1 to k, by k; NaN where `use` does not accept
/// both, and for k = 0.
[[nodiscard]] std::vector<double> log_scales(const GraphSnapshot& graph, const Scene& scene,
                                             const std::function<bool(KeyframeId)>& use);

/// Over all stretches of twenty steps that `use` accepts as a whole.
[[nodiscard]] ScaleChange scale_change(const GraphSnapshot& graph, const Scene& scene,
                                       const std::function<bool(KeyframeId)>& use);

/// Camera centres of all keyframes after the similarity that brings them closest to truth  [m].
[[nodiscard]] std::vector<Vector3> aligned_centres(const GraphSnapshot& graph, const Scene& scene);
/// Root mean square distance of aligned_centres from truth  [m].
[[nodiscard]] double shape_error(const GraphSnapshot& graph, const Scene& scene);

}  // namespace twofold::bench
