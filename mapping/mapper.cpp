#include "mapping/mapper.hpp"

#include <stdexcept>

#include "mapping/keyframe_insertion.hpp"
#include "mapping/relaxation.hpp"

namespace twofold {

std::string MapperOptions::invalid_reason() const {
  if (inner_window < 2) return "inner_window must be at least 2, is " + std::to_string(inner_window);
  if (outer_window < 0) return "outer_window must not be negative, is " + std::to_string(outer_window);
  if (theta < 1) return "theta must be at least 1, is " + std::to_string(theta);
  if (!(constraint_share > 0)) return "constraint_share must be positive";
  return {};
}

Mapper::Mapper(const Rig& rig, const MapperOptions& options) : rig_(rig), options_(options), builder_(rig) {
  if (const std::string reason = options.invalid_reason(); !reason.empty()) throw std::runtime_error(reason);
}

MapperReport Mapper::step(std::span<KeyframeProposal* const> proposals) {
  MapperReport report;
  for (const KeyframeProposal* proposal : proposals) insert_keyframe(writer_, *proposal, options_.theta);
  report.inserted = static_cast<int>(proposals.size());
  if (proposals.empty()) return report;
  optimise_window(report);
  return report;
}

/// Thesis 6.2.3: choose the windows, place who enters, points alone, all together, marginalise who leaves.
void Mapper::optimise_window(MapperReport& report) {
  window_.select(writer_.graph(), options_);
  marginalise_edges();
  WindowProblem& problem = builder_.build(writer_.graph(), window_, options_);
  WindowSolverOptions structure = options_.solver;
  structure.max_iterations = options_.structure_iterations;
  optimise_structure(problem, structure);
  report.solver = solver_.solve(problem, options_.solver);
  report.removed_observations = builder_.write_back(writer_, window_, options_);

  report.inner_window = static_cast<int>(window_.inner_count());
  report.outer_window = static_cast<int>(window_.members().size() - window_.inner_count());
  report.points = static_cast<int>(problem.points.size());
  report.observations = static_cast<int>(problem.observations.size());
  report.constraints = static_cast<int>(problem.constraints.size());
}

/// Keyframes in W1 are defined by their absolute poses, all others by relative edges: an edge that has just
/// lost an end to W2 or beyond keeps the relative pose of the last joint solve, with the information of
/// eq. 6.2; an edge within W1 is free again. Works on the poses of the graph, which are those of the last
/// solve.
void Mapper::marginalise_edges() {
  const auto update = [this](KeyframeId id) {
    const EdgeList edges = *writer_.graph().keyframe(id).edges;
    for (const Edge& edge : edges) {
      const bool both_inner = window_.in_inner(id) && window_.in_inner(edge.other);
      if (edge.marginalised || both_inner) continue;
      Edge sealed = make_edge(writer_.graph(), id, edge.other, edge.weight);
      sealed.marginalised = true;
      writer_.set_edge(id, sealed);
    }
  };
  for (const TreeNode& node : window_.members()) update(node.id);
}

void Mapper::relax_all() {
  relax_graph(writer_, rig_, options_);
}

}  // namespace twofold
