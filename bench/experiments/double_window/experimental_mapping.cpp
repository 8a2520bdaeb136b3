#include "experiments/double_window/experimental_mapping.hpp"

namespace twofold::bench {

ExperimentalMapping::ExperimentalMapping(const Rig& rig, const MapperOptions& mapper,
                                         const ExperimentalMappingOptions& options)
    : rig_(rig), min_covisible_(mapper.min_covisible), fixed_rim_(options.fixed_rim) {
  if (options.own_unit && rig.kind != SensorKind::kMono) unit_.emplace();
  if (options.measured_edges) measurements_.emplace(options.length_share);
}

void ExperimentalMapping::graph_replaced() {
  if (unit_) *unit_ = MapUnit();
  if (measurements_) measurements_->clear();
}

void ExperimentalMapping::edge_leaves(const GraphSnapshot& graph, const WindowProblem& solved,
                                      KeyframeId from, KeyframeId to) {
  if (measurements_) measurements_->measure(graph, solved.rig, from, to);
}

void ExperimentalMapping::constrain(const GraphSnapshot& graph, const Keyframe& from, const Edge& edge,
                                    const IdMap& position, WindowProblem::PoseConstraint& constraint) {
  if (!measurements_) return;
  if (!edge.marginalised && edge.weight >= min_covisible_) {
    constraint.information.setZero();  // not measured yet: its points are those of W1, which speak themselves
  } else if (const auto measured = measurements_->constraint(graph, from.id, edge.other, position)) {
    constraint.T_j_i = measured->T_to_from;
    constraint.information = measured->information;
  }
}

/// In its own unit the problem is solved for shape: the window's disparities tell its points' depths from
/// each other, but with the baseline that suits them best they do not pull at the scale of W2, which the
/// edges hold.
void ExperimentalMapping::before_solve(const DoubleWindow& window, WindowProblem& problem) {
  if (fixed_rim_) {
    for (std::size_t n = window.inner; n < problem.poses.size(); ++n) problem.poses[n].fixed = true;
  }
  if (!unit_) return;
  unit_->read(problem, window);
  problem.rig.baseline = unit_->window_baseline(rig_);
}

void ExperimentalMapping::after_solve(const DoubleWindow& window, const WindowProblem& problem) {
  if (unit_) unit_->read(problem, window);
}

void ExperimentalMapping::loop_closed(KeyframeId from, KeyframeId to) {
  if (measurements_) measurements_->forget(from, to);
}

void ExperimentalMapping::keyframe_culled(KeyframeId id) {
  if (measurements_) measurements_->forget(id);
}

double ExperimentalMapping::metres_per_unit() const {
  return unit_ ? rig_.baseline / unit_->map_baseline(rig_) : 1;
}

}  // namespace twofold::bench
