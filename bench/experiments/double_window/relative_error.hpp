#pragma once

#include <functional>

#include "experiments/double_window/scene.hpp"
#include "graph/snapshot.hpp"

namespace twofold::bench {

/// Sum over edges of the squared error of relative translations, eq. 6.10.
struct EdgeErrorSum {
  double sum = 0;     ///< [m^2]; for one camera of translations of length one
  double scaled = 0;  ///< the same after the one scale that fits these edges best: what is left is not scale
  int edges = 0;

  void add(const EdgeErrorSum& other);
  [[nodiscard]] double rmse() const;
  [[nodiscard]] double scaled_rmse() const;
};

/// Eq. 6.10 over the edges of the scene (not of one method's graph: all are measured by the same) between
/// keyframes of the graph that `use` accepts, lengths of the graph times `metres_per_unit`. For one camera
/// translations are normalised to length one, as in the thesis.
[[nodiscard]] EdgeErrorSum relative_error(const GraphSnapshot& graph, double metres_per_unit,
                                          const Scene& scene, const std::function<bool(KeyframeId)>& use);

}  // namespace twofold::bench
