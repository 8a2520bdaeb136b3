#include "mapping/edges.hpp"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <numbers>

#include "graph/way_length.hpp"

namespace twofold {

void covisible_keyframes(const GraphSnapshot& graph, KeyframeId id, IdMap& counts,
                         std::vector<Covisible>& result) {
  counts.clear();
  result.clear();
  for (const Observation& observation : *graph.keyframe(id).observations) {
    for (const KeyframeId observer : *graph.point(observation.point).observers) {
      if (observer == id) continue;
      int at = counts.find(observer);
      if (at < 0) {
        at = static_cast<int>(result.size());
        counts.set(observer, at);
        result.push_back({observer, 0});
      }
      ++result[static_cast<std::size_t>(at)].points;
    }
  }
  std::sort(result.begin(), result.end(), [](const auto& a, const auto& b) { return a.id < b.id; });
}

int shared_points(const Keyframe& a, const Keyframe& b) {
  int shared = 0;
  for_shared_points(a, b, [&](const auto&, const auto&) { ++shared; });
  return shared;
}

void link(GraphWriter& writer, KeyframeId from, KeyframeId to, int weight) {
  Edge edge;
  edge.other = to;
  edge.weight = weight;
  writer.set_edge(from, edge);
}

void link_marginalised(GraphWriter& writer, KeyframeId from, KeyframeId to, int weight,
                       const SE3& T_to_from) {
  Edge edge;
  edge.other = to;
  edge.weight = weight;
  edge.marginalised = true;
  edge.T_other_this = T_to_from;
  writer.set_edge(from, edge);
}

Matrix6 edge_information(const Keyframe& from, const Keyframe& to, const Edge& edge, const Rig& rig,
                         const EdgeInformationOptions& options) {
  const double ideal = rig.camera.fx / (std::numbers::sqrt2 * rig.noise.sigma_px);
  const double lambda_rot = options.rot_share * ideal;
  const double lambda_trans = options.trans_share * ideal / mean_depth(from, to);
  Vector6 diagonal;
  diagonal.head<3>().setConstant(lambda_trans * lambda_trans);
  diagonal.tail<3>().setConstant(lambda_rot * lambda_rot);
  return Matrix6((std::max(1, edge.weight) * diagonal).asDiagonal());
}

int weight_of_measured_pose(const Matrix6& information, const Keyframe& from, const Keyframe& to,
                            const Rig& rig, const EdgeInformationOptions& options) {
  Edge one_point;
  one_point.weight = 1;
  const Matrix6 of_one = edge_information(from, to, one_point, rig, options);
  // The most points that tell less than the measurement does in every direction.
  const auto tell_less = [&](int points) {
    return Eigen::LLT<Matrix6>(information - points * of_one).info() == Eigen::Success;
  };
  int fewest = 1, most = 1000;
  while (fewest < most) {
    const int middle = (fewest + most + 1) / 2;
    if (tell_less(middle)) {
      fewest = middle;
    } else {
      most = middle - 1;
    }
  }
  return fewest;
}

}  // namespace twofold
