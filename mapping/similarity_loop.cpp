#include "mapping/similarity_loop.hpp"

#include <algorithm>
#include <cmath>

#include "graph/way_length.hpp"
#include "mapping/edges.hpp"
#include "mapping/keyframe_pose_graph.hpp"

namespace twofold {
namespace {

using Similarities = PoseGraph<Sim3>;

/// Eq. 6.2 with the scale: a change of it moves points as translation along their depth does.
Matrix7 similarity_information(const Keyframe& from, const Keyframe& to, const Edge& edge, const Rig& rig,
                               const EdgeInformationOptions& options) {
  Matrix7 information = Matrix7::Zero();
  information.topLeftCorner<6, 6>() = edge_information(from, to, edge, rig, options);
  const double depth = mean_depth(from, to);
  information(6, 6) = depth * depth * information(0, 0);
  return information;
}

/// The loop in the place of an edge.
Similarities::Constraint loop_constraint(const GraphSnapshot& graph, const LoopConstraint& loop, int from,
                                         int to, const Rig& rig, const MapperOptions& options) {
  Edge edge;
  edge.other = loop.to;
  edge.weight = loop.weight;
  return {
      from, to, loop.S_to_from(),
      similarity_information(graph.keyframe(loop.from), graph.keyframe(loop.to), edge, rig, options.edge)};
}

/// All of loop.from's part, so that the loop holds exactly.
void move_other_part(const GraphSnapshot& graph, const LoopConstraint& loop, SimilarityUpdate& update) {
  const KeyframeId part = graph.part(loop.from);
  const Sim3 S_from_new = loop.S_to_from().inverse() * Sim3(graph.T_k_w(loop.to));
  const Sim3 S_old_new = Sim3(graph.T_k_w(loop.from).inverse()) * S_from_new;
  for (std::uint32_t k = 0; k < graph.keyframe_count(); ++k) {
    const Keyframe& keyframe = graph.keyframe(KeyframeId{k});
    if (keyframe.culled() || keyframe.part != part) continue;
    update.poses.push_back({keyframe.id, Sim3(keyframe.T_k_w) * S_old_new});
  }
}

SE3 scaled(const SE3& T, double factor) {
  return {T.so3(), factor * T.translation()};
}

/// By how much lengths around keyframes grow; one for those that stay.
class Factors {
 public:
  explicit Factors(const std::vector<KeyframeScaling>& moved) : moved_(moved) {
    for (std::size_t n = 0; n < moved.size(); ++n) position_.set(moved[n].id, static_cast<int>(n));
  }
  [[nodiscard]] bool moves(KeyframeId id) const { return position_.find(id) >= 0; }
  [[nodiscard]] double of(KeyframeId id) const {
    const int at = position_.find(id);
    return at < 0 ? 1 : moved_[static_cast<std::size_t>(at)].factor;
  }

 private:
  const std::vector<KeyframeScaling>& moved_;
  IdMap position_;
};

/// An edge lies half in either keyframe's unit.
void scale_edges(GraphWriter& writer, KeyframeId id, const Factors& factors) {
  const EdgeList edges = *writer.graph().keyframe(id).edges;
  for (Edge edge : edges) {
    const bool met_from_the_other_end = edge.other < id && factors.moves(edge.other);
    if (!edge.marginalised || met_from_the_other_end) continue;
    edge.T_other_this = scaled(edge.T_other_this, std::sqrt(factors.of(id) * factors.of(edge.other)));
    writer.set_edge(id, edge);
  }
}

/// Points, and the culled keyframes that some of them are anchored in or that somebody may still ask for.
void scale_what_hangs_on(GraphWriter& writer, const Factors& factors) {
  const GraphSnapshot& graph = writer.graph();
  for (std::uint32_t k = 0; k < graph.keyframe_count(); ++k) {
    const KeyframeId id{k};
    if (!graph.keyframe(id).culled()) continue;
    const auto live = graph.live_replacement(id);
    if (live && factors.of(live->id) != 1) writer.scale_replacement(id, factors.of(live->id));
  }
  for (std::uint32_t p = 0; p < graph.point_count(); ++p) {
    const PointId id{p};
    const MapPoint& point = graph.point(id);
    if (point.culled()) continue;
    const double factor = factors.of(graph.live_replacement(point.anchor)->id);
    if (factor != 1) writer.set_inverse_depth(id, {point.psi.x(), point.psi.y(), point.psi.z() / factor});
  }
}

}  // namespace

SimilarityUpdate close_over_sim3(const GraphSnapshot& graph, const LoopConstraint& loop, const Rig& rig,
                                 const MapperOptions& options) {
  SimilarityUpdate update{graph.version(), {loop.to, graph.T_k_w(loop.to)}, graph.part(loop.to), {}};
  if (graph.part(loop.from) != update.part) {
    move_other_part(graph, loop, update);
    return update;
  }
  VisitedSet visited;
  std::vector<TreeNode> tree;
  weighted_breadth_first(graph, loop.to, graph.keyframe_count(), visited, tree);
  IdMap position;
  const auto information = [&](const Keyframe& a, const Keyframe& b, const Edge& edge) {
    return similarity_information(a, b, edge, rig, options.edge);
  };
  Similarities problem = keyframe_pose_graph<Sim3>(graph, tree, information, position);
  const int from = position.find(loop.from);
  if (from < 0) return update;
  problem.constraints.push_back(loop_constraint(graph, loop, from, 0, rig, options));
  PoseGraphSolver<Sim3> solver;
  solver.solve(problem, {});
  for (std::size_t n = 0; n < tree.size(); ++n) update.poses.push_back({tree[n].id, problem.poses[n]});
  return update;
}

std::vector<KeyframeScaling> apply_similarities(GraphWriter& writer, const SimilarityUpdate& update) {
  const GraphSnapshot& graph = writer.graph();
  std::vector<KeyframeScaling> moved;
  if (!graph.live_replacement(update.fixed.id)) return moved;  // culled long ago
  // What the mapper has moved since moves all.
  const SE3 T_then_now = update.fixed.T_k_w.inverse() * graph.T_k_w(update.fixed.id);
  for (const auto& [id, S_k_w] : update.poses) {
    if (!graph.contains(id) || graph.keyframe(id).culled()) continue;
    moved.push_back({id, 1 / S_k_w.scale()});
    writer.set_pose(id, S_k_w.without_scale() * T_then_now);
    writer.set_part(id, update.part);
    writer.set_median_depth(id, graph.keyframe(id).median_depth / S_k_w.scale());
  }
  const Factors factors(moved);
  for (const KeyframeScaling& keyframe : moved) scale_edges(writer, keyframe.id, factors);
  scale_what_hangs_on(writer, factors);
  return moved;
}

}  // namespace twofold
