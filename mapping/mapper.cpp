#include "mapping/mapper.hpp"

#include <algorithm>
#include <chrono>
#include <functional>
#include <stdexcept>
#include <utility>

#include "mapping/edges.hpp"
#include "mapping/map_parts.hpp"
#include "mapping/mapper_hook.hpp"

namespace twofold {
namespace {

/// Adds the time of a scope to a counter.
class ScopeTimer {
 public:
  explicit ScopeTimer(double& ms) : ms_(ms), start_(Clock::now()) {}
  ~ScopeTimer() { ms_ += std::chrono::duration<double, std::milli>(Clock::now() - start_).count(); }
  ScopeTimer(const ScopeTimer&) = delete;
  ScopeTimer& operator=(const ScopeTimer&) = delete;

 private:
  using Clock = std::chrono::steady_clock;
  double& ms_;
  Clock::time_point start_;
};

MapperOptions validated(const MapperOptions& options) {
  if (const std::string reason = options.invalid_reason(); !reason.empty()) {
    throw std::runtime_error("mapper options: " + reason);
  }
  return options;
}

MapperOptions for_camera(const Rig& rig, MapperOptions options) {
  if (rig.kind == SensorKind::kMono)
    options.solver.relative_decrease =
        std::max(options.solver.relative_decrease, options.one_camera_decrease);
  return options;
}

}  // namespace

Mapper::Mapper(const Rig& rig, const MapperOptions& options, PointSearch search)
    : rig_(rig),
      options_(for_camera(rig, validated(options))),
      builder_(rig, options),
      metric_loops_(rig, options, std::move(search)),
      point_culler_(rig, options.culling) {}

Mapper::Mapper(const Rig& rig, const MapperOptions& options)
    : Mapper(rig, options, guided_point_search(rig, options.loop.search_radius_px)) {}

void Mapper::continue_from(const GraphSnapshot& graph) {
  writer_ = GraphWriter(graph);
  // The windows that they were in are gone, and the new ones may form elsewhere: edges without a constraint
  // would never get one, and whatever does not fit together would be put on them alone.
  marginalise_all_edges(writer_);
  // Nothing is known about which absolute poses agree: the first window is set along edges from its
  // reference.
  window_ = next_window_ = DoubleWindow();
  consistent_.clear();
  if (options_.hook) options_.hook->graph_replaced();
  if (graph.reference() != kNoKeyframe) consistent_.set(graph.reference(), 0);
}

MapperReport Mapper::step(std::span<KeyframeProposal* const> proposals,
                          std::span<const LoopConstraint> loops) {
  MapperReport report;
  report.joined = std::exchange(joined_, 0);
  inserted_.clear();
  for (const KeyframeProposal* proposal : proposals) insert(*proposal, report);
  for (const LoopConstraint& loop : loops) add_loop(loop, report);
  if (graph().reference() == kNoKeyframe) return report;
  form_windows(report);
  optimise(report);
  remove_outliers(report);
  close_metric_loops(proposals, report);
  cull(report);
  return report;
}

void Mapper::insert(const KeyframeProposal& proposal, MapperReport& report) {
  const ScopeTimer time(report.ms.insert);
  const InsertionReport insertion =
      insert_keyframe(writer_, proposal, options_.min_covisible, consistent_, counts_);
  keep_measured_pose(writer_, proposal, rig_, options_);
  inserted_.push_back(proposal.id);
  ++report.inserted;
  report.new_points += insertion.new_points;
  report.dropped_observations += insertion.dropped_observations;
}

void Mapper::add_loop(const LoopConstraint& loop, MapperReport& report) {
  if (!graph().contains(loop.from) || !graph().contains(loop.to)) {
    ++report.late_loops;
    return;
  }
  // A constraint of a keyframe that was culled in the meantime passes to its replacement.
  const auto live_from = graph().live_replacement(loop.from), live_to = graph().live_replacement(loop.to);
  if (!live_from || !live_to) {
    ++report.late_loops;
    return;
  }
  const auto& [from, T_loop_from] = *live_from;
  const auto& [to, T_loop_to] = *live_to;
  if (from == to) return;
  const SE3 T_to_from = T_loop_to.inverse() * loop.T_to_from * T_loop_from;
  report.joined += join_parts(writer_, from, to, T_to_from);
  link_marginalised(writer_, from, to, loop.weight, T_to_from);
  if (options_.hook) options_.hook->loop_closed(from, to);
  writer_.announce_change(report.joined > 0 ? MapChange::Kind::kPartsJoined : MapChange::Kind::kLoopClosure);
  loop_closed_ = true;
  ++report.loops;
}

/// Both windows around the reference; edges that W1 leaves behind; poses and edges of what entered  (6.2.3).
void Mapper::form_windows(MapperReport& report) {
  const ScopeTimer time(report.ms.window);
  select_double_window(graph(), options_, selection_, next_window_);
  leave_inner_window(report);
  report.poses_set = enter_window(writer_, consistent_, next_window_);
  std::swap(window_, next_window_);
  for (const KeyframeId id : inserted_) {
    register_in_window(writer_, id, window_, options_.min_covisible, counts_);
  }
  consistent_.clear();
  for (const TreeNode& node : window_.nodes) consistent_.set(node.id, 0);
  report.inner_window = static_cast<int>(window_.inner);
  report.outer_window = static_cast<int>(window_.nodes.size() - window_.inner);
}

void Mapper::leave_inner_window(MapperReport& report) {
  std::function<void(KeyframeId, KeyframeId)> leaves;
  if (options_.hook) {
    leaves = [&](KeyframeId from, KeyframeId to) {
      options_.hook->edge_leaves(graph(), builder_.problem(), from, to);
    };
  }
  report.edges_marginalised = marginalise_left_edges(writer_, window_, next_window_, leaves);
}

/// Structure-only after poses were set, then eq. 6.4 over everything in the windows.
void Mapper::optimise(MapperReport& report) {
  {
    const ScopeTimer time(report.ms.build);
    builder_.build(graph(), window_);
    report.points = static_cast<int>(builder_.problem().points.size());
    report.observations = static_cast<int>(builder_.problem().observations.size());
    report.constraints = static_cast<int>(builder_.problem().constraints.size());
  }
  {
    const ScopeTimer time(report.ms.solve);
    if (report.poses_set > 0 && options_.structure_iterations > 0) {
      WindowSolverOptions structure = options_.solver;
      structure.max_iterations = options_.structure_iterations;
      optimise_structure(builder_.problem(), structure);
    }
    if (options_.hook) options_.hook->before_solve(window_, builder_.problem());
    report.solver = solver_.solve(builder_.problem(), options_.solver);
    if (options_.hook) options_.hook->after_solve(window_, builder_.problem());
  }
  const ScopeTimer time(report.ms.write);
  builder_.write_back(writer_, window_);
}

void Mapper::remove_outliers(MapperReport& report) {
  const ScopeTimer time(report.ms.cull);
  builder_.find_outliers(window_, outliers_);
  report.outliers = static_cast<int>(outliers_.size());
  report.culled_points += remove_outlier_observations(writer_, outliers_);
}

/// Of each new keyframe: one that is left out, because the mapper was behind and inserts several, would keep
/// points of its own beside those that the map has there, and never become redundant.
void Mapper::close_metric_loops(std::span<KeyframeProposal* const> proposals, MapperReport& report) {
  if (!options_.loop.enabled) return;
  const ScopeTimer time(report.ms.loop);
  for (const KeyframeProposal* proposal : proposals)
    report.loop_search += metric_loops_.close(writer_, window_, proposal->id, proposal->images);
  report.metric_loops = report.loop_search.edges;
}

void Mapper::cull(MapperReport& report) {
  const ScopeTimer time(report.ms.cull);
  if (options_.culling.points && !inserted_.empty()) {
    report.culled_points += point_culler_.cull(writer_, inserted_.back(), builder_.point_ids());
  }
  if (options_.culling.keyframes) {
    report.culled_keyframes =
        cull_redundant_keyframes(writer_, window_, options_.culling, inserted_.size(), report.culled_points);
    writer_.forget_replacements(static_cast<std::size_t>(options_.culling.keep_replacements));
    if (options_.hook) {
      for (const KeyframeId id : report.culled_keyframes) options_.hook->keyframe_culled(id);
    }
  }
}

int Mapper::take_pose_graph(const PoseGraphUpdate& update) {
  IdMap position;
  for (std::size_t n = 0; n < update.poses.size(); ++n) {
    position.set(update.poses[n].id, static_cast<int>(n));
  }
  // Window nodes are in breadth-first order around the reference.
  const auto fixed = std::find_if(window_.nodes.begin(), window_.nodes.end(), [&](const TreeNode& node) {
    return position.contains(node.id) && !graph().keyframe(node.id).culled();
  });
  if (fixed == window_.nodes.end()) return 0;
  const SE3& T_fixed_optimised = update.poses[static_cast<std::size_t>(position.find(fixed->id))].T_k_w;
  const SE3 T_optimised_w = T_fixed_optimised.inverse() * graph().keyframe(fixed->id).T_k_w;
  int moved = 0;
  for (const KeyframePose& pose : update.poses) {
    if (window_.contains(pose.id) || graph().keyframe(pose.id).culled()) continue;
    writer_.set_pose(pose.id, pose.T_k_w * T_optimised_w);
    ++moved;
  }
  if (moved > 0) writer_.announce_change(MapChange::Kind::kPoseGraph);
  return moved;
}

std::vector<KeyframeScaling> Mapper::take_similarities(const SimilarityUpdate& update) {
  const GraphSnapshot before = graph();
  std::vector<KeyframeScaling> moved = apply_similarities(writer_, update);
  joined_ += static_cast<int>(std::count_if(moved.begin(), moved.end(), [&](const KeyframeScaling& keyframe) {
    return before.part(keyframe.id) != update.part;
  }));
  // Whether the loop follows, or comes too late.
  if (!moved.empty())
    writer_.announce_change(joined_ > 0 ? MapChange::Kind::kPartsJoined : MapChange::Kind::kLoopClosure);
  return moved;
}

PoseGraphReport Mapper::optimise_all_poses() {
  return optimise_all_components(writer_, rig_, options_);
}

GlobalAdjustmentReport Mapper::adjust_all() {
  if (!options_.global.enabled || (rig_.kind != SensorKind::kMono && !loop_closed_)) return {};
  return adjust_all_components(writer_, rig_, options_);
}

}  // namespace twofold
