#include "mapping/global_adjustment.hpp"

#include <cmath>
#include <limits>
#include <optional>
#include <vector>

#include "estimation/window_solver.hpp"
#include "graph/neighbourhood.hpp"
#include "mapping/culling.hpp"
#include "mapping/double_window.hpp"
#include "mapping/window_builder.hpp"

namespace twofold {
namespace {

MapperOptions without_budget(const MapperOptions& options) {
  MapperOptions all = options;
  all.max_points = std::numeric_limits<int>::max();
  all.solver.max_iterations = options.global.max_iterations;
  all.solver.initial_damping = options.global.initial_damping;
  all.solver.relative_decrease = options.global.relative_decrease;
  return all;
}

/// What each round removes the next one does without.
void adjust(GraphWriter& writer, const DoubleWindow& window, const MapperOptions& options,
            WindowBuilder& builder, GlobalAdjustmentReport& report) {
  WindowSolver solver;
  std::vector<WindowBuilder::Outlier> outliers;
  for (int round = 0; round < options.global.rounds; ++round) {
    builder.build(writer.graph(), window);
    WindowProblem& problem = builder.problem();
    problem.poses.front().fixed = true;
    // Poses have come from the pose graph, which knows no points.
    if (round == 0) optimise_structure(problem, options.solver);
    const SolverSummary summary = solver.solve(problem, options.solver);
    builder.write_back(writer, window);
    builder.find_outliers(window, outliers);
    remove_outlier_observations(writer, outliers);
    report.outliers += static_cast<int>(outliers.size());
    if (round == 0) {
      report.points += static_cast<int>(problem.points.size());
      report.observations += static_cast<int>(problem.observations.size());
      report.initial_cost += summary.initial_cost;
    }
    if (round == options.global.rounds - 1 || outliers.empty()) {
      report.final_cost += summary.final_cost;
      return;
    }
  }
}

std::optional<FocalLengthEstimate> focal_length_of(WindowProblem& problem, const MapperOptions& options) {
  const double systematic = options.global.focal_sigma;
  auto found = estimate_focal_length(problem, options.solver, 2 * systematic);
  if (!found || found->sigma > systematic) return std::nullopt;
  found->sigma = std::hypot(found->sigma, found->scale * systematic);
  return found;
}

}  // namespace

GlobalAdjustmentReport adjust_all_components(GraphWriter& writer, const Rig& rig,
                                             const MapperOptions& options) {
  GlobalAdjustmentReport report;
  const MapperOptions all = without_budget(options);
  for_each_component(writer.graph(), [&](const std::vector<TreeNode>& tree) {
    if (tree.size() > static_cast<std::size_t>(options.global.max_keyframes)) {
      ++report.too_large;
      return;
    }
    const DoubleWindow window = inner_window_of(tree);
    WindowBuilder builder(rig, all);
    adjust(writer, window, all, builder, report);
    if (rig.kind == SensorKind::kMono && window.contains(writer.graph().reference()))
      report.focal_length = focal_length_of(builder.problem(), all);
    marginalise_edges_of(writer, window);
    ++report.components;
    report.keyframes += static_cast<int>(tree.size());
  });
  return report;
}

}  // namespace twofold
