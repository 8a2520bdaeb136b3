#include <CLI/CLI.hpp>
#include <algorithm>
#include <atomic>
#include <exception>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include <fmt/core.h>
#include <opencv2/core.hpp>

#include "engine/engine.hpp"
#include "evaluation/evaluation.hpp"
#include "io/plots/plot.hpp"
#include "io/sources/open_source.hpp"
#include "loopclosure/default_vocabulary.hpp"
#include "mapping/edges.hpp"
#include "mapping/keyframe_pose_graph.hpp"
#include "mapping/mapper_hook.hpp"
#include "mapping/similarity_loop.hpp"

// One camera round a loop, its scale drift corrected over Sim(3), and the same run with its loops closed over
// SE(3): a table, and both paths from above side by side  (thesis 5.4, fig. 5.3).
//
// Twice: with the pose graph alone, as the thesis compares them, on one and the same map as it was when its
// first large loop was found; and at the end of either run, when the double windows have gone on adjusting.

namespace twofold {
namespace {

struct ClosedRun {
  RunResult result;
  Trajectory poses, causal;
  GraphSnapshot before_loop;  ///< the map before the first large loop was taken in
  Rig rig;
  MapperOptions mapper;
};

/// Closes loops as if the unit of length were known.
class RigidLoops : public MapperHook {
 public:
  [[nodiscard]] bool scale_drifts() const override { return false; }
};

struct Windows {
  int inner = MapperOptions{}.inner_window, outer = MapperOptions{}.outer_window;  ///< keyframes
};

ClosedRun run(const std::string& text, const Windows& windows, bool over_sim3, Trajectory& truth) {
  SourceOptions source_options;
  source_options.left_only = true;
  const auto source = open_source(text, source_options);
  truth = source->ground_truth();
  EngineOptions options;
  options.deterministic = true;
  options.vocabulary = std::make_shared<const Vocabulary>(load_default_vocabulary());
  options.mapper.inner_window = windows.inner;
  options.mapper.outer_window = windows.outer;
  options.mapper.global.enabled = false;  // it would take back most of what the loop did, over either group
  if (!over_sim3) options.mapper.hook = std::make_shared<RigidLoops>();
  GraphSnapshot newest, before_loop;
  options.on_map = [&](const GraphSnapshot& graph, const DoubleWindow&) {
    if (graph.last_change().version != 0 && before_loop.keyframe_count() == 0) before_loop = newest;
    newest = graph;
  };
  const std::atomic<bool> interrupted{false};
  ClosedRun run{
      Engine(source->rig(), options).run([&](Frame& frame) { return source->next(frame); }, interrupted),
      {},
      {},
      before_loop,
      source->rig(),
      options.mapper};
  if (!run.result.error.empty()) throw std::runtime_error(run.result.error);
  for (const FrameRecord& record : run.result.frames) {
    if (!has_final_pose(record) || !run.result.graph.contains(record.reference)) continue;
    run.poses.push_back({record.t_ns, final_T_c_w(record, run.result.graph).inverse()});
    if (record.state == FrameState::kTracked)
      run.causal.push_back({record.t_ns, record.T_c_w_causal.unpacked().inverse()});
  }
  return run;
}

std::optional<Evaluation> line(const char* name, const Trajectory& poses, const Trajectory& truth) {
  auto evaluation = evaluate(associate(poses, truth, 10'000'000), {.alignment = Alignment::kSim3});
  if (!evaluation) {
    fmt::print("{:<22} {}\n", name, evaluation.error());
    return std::nullopt;
  }
  const auto halves = evaluation->half_scales.value_or(std::array<double, 2>{0, 0});
  fmt::print("{:<22} {:9.4f} {:9.4f} {:9.2f} {:9.2f}\n", name, evaluation->absolute.rmse,
             100 * evaluation->absolute.rmse / evaluation->path_length,
             evaluation->absolute_rotation_deg.rmse, 100 * std::abs(halves[0] / halves[1] - 1));
  return *std::move(evaluation);
}

/// Centres of keyframes after a pose graph.
Trajectory centres(const GraphSnapshot& graph, const std::vector<KeyframePose>& poses) {
  Trajectory result;
  for (const KeyframePose& pose : poses)
    result.push_back({graph.keyframe(pose.id).t_ns, pose.T_k_w.inverse()});
  std::sort(result.begin(), result.end(), [](auto& a, auto& b) { return a.t_ns < b.t_ns; });
  return result;
}

/// The pose graph that close_over_sim3 solves, over SE(3): the loop is one edge more, its scale is left out.
std::vector<KeyframePose> close_over_se3(const ClosedRun& run, const LoopConstraint& loop) {
  const GraphSnapshot& graph = run.before_loop;
  VisitedSet visited;
  std::vector<TreeNode> tree;
  weighted_breadth_first(graph, loop.to, graph.keyframe_count(), visited, tree);
  IdMap position;
  const auto information = [&](const Keyframe& from, const Keyframe& to, const Edge& edge) {
    return edge_information(from, to, edge, run.rig, run.mapper.edge);
  };
  PoseGraph<SE3> problem = keyframe_pose_graph<SE3>(graph, tree, information, position);
  Edge edge;
  edge.other = loop.to;
  edge.weight = std::max(1, loop.inliers);
  problem.constraints.push_back({position.find(loop.from), 0, loop.T_to_from,
                                 information(graph.keyframe(loop.from), graph.keyframe(loop.to), edge)});
  PoseGraphSolver<SE3> solver;
  solver.solve(problem, {});
  std::vector<KeyframePose> poses;
  for (std::size_t n = 0; n < tree.size(); ++n) poses.push_back({tree[n].id, problem.poses[n]});
  return poses;
}

/// The first large loop, closed by a pose graph over either group, and nothing after it.
void compare_pose_graphs(const ClosedRun& run, const Trajectory& truth) {
  const GraphSnapshot& graph = run.before_loop;
  if (run.result.loops.empty()) return;
  const LoopConstraint& loop = run.result.loops.front().constraint;
  for (const KeyframeId id : {loop.from, loop.to})
    if (!graph.contains(id) || graph.keyframe(id).culled()) return;
  if (graph.part(loop.from) != graph.part(loop.to)) return;
  std::vector<KeyframePose> over_sim3, as_it_was;
  for (const KeyframeSimilarity& pose : close_over_sim3(graph, loop, run.rig, run.mapper).poses) {
    over_sim3.push_back({pose.id, pose.S_k_w.without_scale()});
    as_it_was.push_back({pose.id, graph.T_k_w(pose.id)});
  }
  fmt::print("pose graph alone, {} keyframes, first loop\n", over_sim3.size());
  (void)line("before", centres(graph, as_it_was), truth);
  const auto sim3 = line("over Sim(3)", centres(graph, over_sim3), truth);
  const auto se3 = line("over SE(3)", centres(graph, close_over_se3(run, loop)), truth);
  if (sim3 && se3) fmt::print("SE(3) / Sim(3): {:.2f}\n", se3->absolute.rmse / sim3->absolute.rmse);
}

void print_loops(const RunResult& result) {
  for (const ClosedLoop& loop : result.loops) {
    const SE3 drift = loop.drift();
    fmt::print("  loop of keyframes {} and {}: scale {:.4f}, drift {:.2f} % of the way, {:.2f} degrees\n",
               index(loop.constraint.from), index(loop.constraint.to), loop.constraint.scale,
               100 * drift.translation().norm() / std::max(loop.travelled, 1e-9),
               drift.so3().log().norm() * 57.29578);
  }
}

cv::Mat picture(const char* name, const Evaluation& evaluation, const Trajectory& truth) {
  PlotOptions plot;
  plot.title = fmt::format("loops closed over {}", name);
  plot.subtitle = fmt::format("ATE {:.3f} m", evaluation.absolute.rmse);
  plot.up_axis = up_axis_of(truth);
  Trajectory poses;
  for (const PosePair& pair : evaluation.pairs) poses.push_back({pair.t_ns, pair.T_e_c});
  return draw_top_down({{"ground truth", positions(truth), plot_colours::kTruth, 4, {}},
                        {name, positions(poses), plot_colours::kFinal, 2, {}}},
                       plot);
}

void compare(const std::string& source, const Windows& windows, const std::string& file) {
  Trajectory truth;
  const ClosedRun over_sim3 = run(source, windows, true, truth),
                  over_se3 = run(source, windows, false, truth);
  print_loops(over_sim3.result);
  fmt::print("{:<22} {:>9} {:>9} {:>9} {:>9}\n", source.substr(0, 22), "ATE m", "% of path", "degrees",
             "halves %");
  compare_pose_graphs(over_sim3, truth);
  fmt::print("at the end of the run\n");
  (void)line("as it was known", over_sim3.causal, truth);
  const auto sim3 = line("closed over Sim(3)", over_sim3.poses, truth);
  const auto se3 = line("closed over SE(3)", over_se3.poses, truth);
  if (!sim3 || !se3) return;
  fmt::print("SE(3) / Sim(3): {:.2f}\n", se3->absolute.rmse / sim3->absolute.rmse);
  if (file.empty()) return;
  cv::Mat both;
  cv::Mat left = picture("SE(3)", *se3, truth), right = picture("Sim(3)", *sim3, truth);
  const int rows = std::max(left.rows, right.rows);
  for (cv::Mat* image : {&left, &right})
    cv::copyMakeBorder(*image, *image, 0, rows - image->rows, 0, 0, cv::BORDER_CONSTANT, {255, 255, 255});
  cv::hconcat(left, right, both);
  write_png(file, both);
}

}  // namespace
}  // namespace twofold

int main(int argc, char** argv) {
  std::string source = "synthetic:cloister", picture;
  CLI::App app("One camera's loops closed over Sim(3) and over SE(3)");
  app.add_option("source", source, "a source with ground truth");
  twofold::Windows windows;
  app.add_option("--inner-window", windows.inner, "Keyframes; fewer than usual let scale drift")
      ->capture_default_str();
  app.add_option("--outer-window", windows.outer, "Keyframes")->capture_default_str();
  app.add_option("--picture", picture, "PNG file: both paths side by side");
  CLI11_PARSE(app, argc, argv);
  try {
    twofold::compare(source, windows, picture);
  } catch (const std::exception& error) {
    fmt::print(stderr, "{}\n", error.what());
    return 1;
  }
  return 0;
}
