#include "experiments/double_window/scale_consistency.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

#include "geometry/absolute_orientation.hpp"

namespace twofold::bench {

void ScaleChange::add(const ScaleChange& other) {
  squares += other.squares;
  pairs += other.pairs;
}

double ScaleChange::rms() const {
  return pairs > 0 ? std::sqrt(squares / pairs) : 0;
}

std::vector<double> log_scales(const GraphSnapshot& graph, const Scene& scene,
                               const std::function<bool(KeyframeId)>& use) {
  std::vector<double> scales(graph.keyframe_count(), std::numeric_limits<double>::quiet_NaN());
  for (std::uint32_t k = 1; k < graph.keyframe_count(); ++k) {
    const KeyframeId i{k}, j{k - 1};
    if (!use(i) || !use(j)) continue;
    const SE3 estimated = graph.T_k_w(i) * graph.T_k_w(j).inverse();
    const SE3 truth = scene.T_k_w[k] * scene.T_k_w[k - 1].inverse();
    scales[k] = std::log(estimated.translation().norm() / truth.translation().norm());
  }
  return scales;
}

ScaleChange scale_change(const GraphSnapshot& graph, const Scene& scene,
                         const std::function<bool(KeyframeId)>& use) {
  constexpr std::ptrdiff_t kSteps = 10;
  const std::vector<double> scales = log_scales(graph, scene, use);
  ScaleChange change;
  for (auto at = scales.begin(); scales.end() - at >= 2 * kSteps; ++at) {
    const double before = std::accumulate(at, at + kSteps, 0.0) / kSteps;
    const double after = std::accumulate(at + kSteps, at + 2 * kSteps, 0.0) / kSteps;
    if (std::isnan(before) || std::isnan(after)) continue;
    change.squares += (after - before) * (after - before);
    ++change.pairs;
  }
  return change;
}

std::vector<Vector3> aligned_centres(const GraphSnapshot& graph, const Scene& scene) {
  std::vector<Vector3> centres, truth;
  for (std::uint32_t k = 0; k < graph.keyframe_count(); ++k) {
    centres.push_back(graph.T_k_w(KeyframeId{k}).inverse().translation());
    truth.push_back(scene.T_k_w[k].inverse().translation());
  }
  if (const auto S_truth_map = align_similarity(truth, centres)) {
    for (Vector3& c : centres) c = *S_truth_map * c;
  }
  return centres;
}

double shape_error(const GraphSnapshot& graph, const Scene& scene) {
  const std::vector<Vector3> centres = aligned_centres(graph, scene);
  double squares = 0;
  for (std::size_t k = 0; k < centres.size(); ++k) {
    squares += (centres[k] - scene.T_k_w[k].inverse().translation()).squaredNorm();
  }
  return std::sqrt(squares / static_cast<double>(std::max<std::size_t>(1, centres.size())));
}

}  // namespace twofold::bench
