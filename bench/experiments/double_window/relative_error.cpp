#include "experiments/double_window/relative_error.hpp"

#include <algorithm>
#include <cmath>

namespace twofold::bench {

void EdgeErrorSum::add(const EdgeErrorSum& other) {
  sum += other.sum;
  scaled += other.scaled;
  edges += other.edges;
}

double EdgeErrorSum::rmse() const {
  return edges > 0 ? std::sqrt(sum / edges) : 0;
}

double EdgeErrorSum::scaled_rmse() const {
  return edges > 0 ? std::sqrt(scaled / edges) : 0;
}

EdgeErrorSum relative_error(const GraphSnapshot& graph, double metres_per_unit, const Scene& scene,
                            const std::function<bool(KeyframeId)>& use) {
  EdgeErrorSum error;
  double product = 0, estimated_squared = 0, truth_squared = 0;
  const bool mono = scene.rig.kind == SensorKind::kMono;
  for (std::uint32_t k = 0; k < graph.keyframe_count(); ++k) {
    const KeyframeId i{k};
    if (!use(i)) continue;
    for (const int earlier : scene.covisible[k]) {
      const KeyframeId j{static_cast<std::uint32_t>(earlier)};
      if (!use(j)) continue;
      Vector3 estimated = metres_per_unit * (graph.T_k_w(i) * graph.T_k_w(j).inverse()).translation();
      Vector3 truth = (scene.T_k_w[k] * scene.T_k_w[index(j)].inverse()).translation();
      if (mono) {
        estimated.normalize();
        truth.normalize();
      }
      error.sum += (estimated - truth).squaredNorm();
      product += estimated.dot(truth);
      estimated_squared += estimated.squaredNorm();
      truth_squared += truth.squaredNorm();
      ++error.edges;
    }
  }
  if (estimated_squared > 0) {
    error.scaled = std::max(0.0, truth_squared - product * product / estimated_squared);
  }
  return error;
}

}  // namespace twofold::bench
