#include "experiments/double_window/drift_mapper.hpp"

#include <algorithm>
#include <cmath>

namespace twofold::bench {
namespace {

bool same(double a, double b) {
  return std::abs(a - b) < 1e-9 * std::abs(a);
}

}  // namespace

DriftMapper::DriftMapper(const Rig& rig, const MapperOptions& options, LoopGroup group)
    : options_(options), group_(group), builder_(rig, options) {}

double& DriftMapper::scale(KeyframeId id) {
  if (index(id) >= scale_.size()) scale_.resize(index(id) + 1, 1);
  return scale_[index(id)];
}

DriftMapper::EdgeScales DriftMapper::edge_scales(KeyframeId a, KeyframeId b) const {
  const auto at = edge_scales_.find({std::min(a, b), std::max(a, b)});
  EdgeScales scales;
  if (at != edge_scales_.end()) scales = at->second;
  if (b < a) std::swap(scales.first, scales.second);
  return scales;
}

void DriftMapper::store_edge_scales(KeyframeId a, KeyframeId b) {
  const auto [first, second] = std::minmax(a, b);
  if (scale(first) == 1 && scale(second) == 1) {
    edge_scales_.erase({first, second});
  } else {
    edge_scales_[{first, second}] = {scale(first), scale(second)};
  }
}

MapperReport DriftMapper::step(const KeyframeProposal& proposal) {
  MapperReport report;
  insert_keyframe(writer_, proposal, options_.min_covisible, consistent_, counts_);
  // Its lengths are those of the map it was tracked in, as that map stands.
  if (proposal.reference != kNoKeyframe) scale(proposal.id) = scale(proposal.reference);
  changed_.push_back(proposal.id);
  move_window(report);
  return report;
}

/// Windows around the reference, and eq. 6.4 over them.
void DriftMapper::move_window(MapperReport& report) {
  select_double_window(graph(), options_, selection_, next_window_);
  report.edges_marginalised = marginalise_left_edges(writer_, window_, next_window_);
  propagate_scale(next_window_);
  report.poses_set = enter_window(writer_, consistent_, next_window_);
  std::swap(window_, next_window_);
  for (const KeyframeId id : changed_)
    register_in_window(writer_, id, window_, options_.min_covisible, counts_);
  changed_.clear();
  consistent_.clear();
  for (const TreeNode& node : window_.nodes) consistent_.set(node.id, 0);
  report.inner_window = static_cast<int>(window_.inner);
  report.outer_window = static_cast<int>(window_.nodes.size() - window_.inner);
  optimise(report);
  store_window_scales();
}

/// Relative poses between members of W1 follow the absolute ones until they are stored on leaving it: with
/// the scales of now.
void DriftMapper::store_window_scales() {
  for (std::size_t n = 0; n < window_.inner; ++n) {
    const KeyframeId id = window_.nodes[n].id;
    for (const Edge& edge : *graph().keyframe(id).edges) {
      if (!edge.marginalised || window_.is_inner(edge.other)) store_edge_scales(id, edge.other);
    }
  }
}

MapperReport DriftMapper::close(SimilarityConstraint loop, std::span<const PointCopies> copies) {
  if (group_ == LoopGroup::kSe3) loop.S_to_from = Sim3(loop.S_to_from.without_scale());
  // All relative poses become constraints, so that those on the far side of the loop can be rescaled.
  marginalise_left_edges(writer_, window_, {});
  unite(copies);
  link_marginalised(writer_, loop.from, loop.to, loop.inliers, loop.S_to_from.without_scale());
  EdgeScales scales{scale(loop.from), scale(loop.from) * loop.S_to_from.scale()};
  if (loop.to < loop.from) std::swap(scales.first, scales.second);
  edge_scales_[{std::min(loop.from, loop.to), std::max(loop.from, loop.to)}] = scales;
  if (window_.contains(loop.to)) spread(loop);
  MapperReport report;
  move_window(report);
  return report;
}

void DriftMapper::spread(const SimilarityConstraint& loop) {
  const std::vector<Sim3> S_k_w = optimise_loop(graph(), window_, loop, group_);
  for (std::size_t n = 0; n < window_.nodes.size(); ++n) {
    const KeyframeId id = window_.nodes[n].id;
    writer_.set_pose(id, S_k_w[n].without_scale());
    rescale_keyframe(id, scale(id) * S_k_w[n].scale());
  }
  for (const TreeNode& node : window_.nodes) {
    const EdgeList edges = *graph().keyframe(node.id).edges;
    for (const Edge& edge : edges) {
      if (edge.other < node.id && window_.contains(edge.other)) rescale_edge(node.id, edge);
    }
  }
}

/// All that measured the recent copies measures the old ones.
void DriftMapper::unite(std::span<const PointCopies> copies) {
  std::map<KeyframeId, std::vector<Observation>> moved;
  for (const PointCopies& pair : copies) {
    for (const KeyframeId observer : *graph().point(pair.recent).observers) {
      Observation observation = *find_observation(graph().keyframe(observer), pair.recent);
      observation.point = pair.old;
      moved[observer].push_back(observation);
    }
    writer_.cull_point(pair.recent);
  }
  for (auto& [observer, observations] : moved) {
    std::sort(observations.begin(), observations.end(),
              [](const Observation& a, const Observation& b) { return a.point < b.point; });
    writer_.add_observations(observer, observations);
    changed_.push_back(observer);
  }
}

/// Scales of the poses that eq. 6.3 is about to set.
void DriftMapper::propagate_scale(const DoubleWindow& window) {
  std::vector<bool> reset(window.nodes.size(), false);
  std::vector<KeyframeId> changed;
  for (std::size_t n = 1; n < window.nodes.size(); ++n) {
    const KeyframeId id = window.nodes[n].id;
    const auto parent = static_cast<std::size_t>(window.nodes[n].parent);
    reset[n] = reset[parent] || !consistent_.contains(id);
    if (!reset[n]) continue;
    const KeyframeId parent_id = window.nodes[parent].id;
    const EdgeScales then = edge_scales(parent_id, id);
    const double now = then.second * scale(parent_id) / then.first;
    if (same(now, scale(id))) continue;
    rescale_keyframe(id, now);
    changed.push_back(id);
  }
  for (const KeyframeId id : changed) rescale_edges(id);
}

void DriftMapper::rescale_keyframe(KeyframeId id, double new_scale) {
  const double factor = new_scale / scale(id);  // x / s: inverse depths grow with s
  for (const Observation& observation : *graph().keyframe(id).observations) {
    const MapPoint& point = graph().point(observation.point);
    if (point.anchor != id) continue;
    writer_.set_inverse_depth(observation.point, {point.psi.x(), point.psi.y(), point.psi.z() * factor});
  }
  writer_.set_median_depth(id, graph().keyframe(id).median_depth / factor);
  scale(id) = new_scale;
}

/// Edges both of whose ends have changed by the same factor since their relative pose was stored.
void DriftMapper::rescale_edges(KeyframeId id) {
  const EdgeList edges = *graph().keyframe(id).edges;
  for (const Edge& edge : edges) {
    const EdgeScales then = edge_scales(id, edge.other);
    const double factor = scale(id) / then.first;
    if (same(factor, 1) || !same(factor, scale(edge.other) / then.second)) continue;
    rescale_edge(id, edge);
  }
}

/// Its length goes by the mean of the factors of its ends.
void DriftMapper::rescale_edge(KeyframeId id, const Edge& edge) {
  if (!edge.marginalised) return;
  const EdgeScales then = edge_scales(id, edge.other);
  const double factor = std::sqrt(scale(id) / then.first * scale(edge.other) / then.second);
  const SE3 T_other_id(edge.T_other_this.so3(), edge.T_other_this.translation() / factor);
  link_marginalised(writer_, id, edge.other, edge.weight, T_other_id);
  store_edge_scales(id, edge.other);
}

void DriftMapper::optimise(MapperReport& report) {
  builder_.build(graph(), window_);
  report.points = static_cast<int>(builder_.problem().points.size());
  report.observations = static_cast<int>(builder_.problem().observations.size());
  report.constraints = static_cast<int>(builder_.problem().constraints.size());
  if (report.poses_set > 0) {
    WindowSolverOptions structure = options_.solver;
    structure.max_iterations = options_.structure_iterations;
    optimise_structure(builder_.problem(), structure);
  }
  report.solver = solver_.solve(builder_.problem(), options_.solver);
  builder_.write_back(writer_, window_);
}

}  // namespace twofold::bench
