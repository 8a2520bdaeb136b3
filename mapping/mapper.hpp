#pragma once

#include <span>
#include <vector>

#include "estimation/window_solver.hpp"
#include "graph/graph_writer.hpp"
#include "graph/keyframe_proposal.hpp"
#include "graph/loop_constraint.hpp"
#include "mapping/culling.hpp"
#include "mapping/double_window.hpp"
#include "mapping/global_adjustment.hpp"
#include "mapping/insertion.hpp"
#include "mapping/metric_loop.hpp"
#include "mapping/options.hpp"
#include "mapping/pose_graph_optimisation.hpp"
#include "mapping/similarity_loop.hpp"
#include "mapping/window_builder.hpp"

namespace twofold {

/// What one round of the mapper did.
struct MapperReport {
  int inserted = 0;  ///< keyframes
  int new_points = 0;
  int dropped_observations = 0;  ///< of points culled or unknown
  int loops = 0;                 ///< loop constraints accepted
  int late_loops = 0;            ///< dropped: the map has forgotten, or never had, their keyframes
  int joined = 0;                ///< keyframes of parts that were moved to join others, since the last round

  int inner_window = 0;  ///< |W1|
  int outer_window = 0;  ///< |W2|, anchors included
  int points = 0;
  int observations = 0;
  int constraints = 0;
  int poses_set = 0;           ///< on window entry
  int edges_marginalised = 0;  ///< of keyframes that left W1
  SolverSummary solver;

  int outliers = 0;              ///< observations removed
  int metric_loops = 0;          ///< edges added by metric loop closure
  MetricLoopReport loop_search;  ///< of all that were inserted
  int culled_points = 0;
  std::vector<KeyframeId> culled_keyframes;

  /// Wall time of the stages, for statistics only [ms].
  struct Times {
    double insert = 0, window = 0, build = 0, solve = 0, write = 0, loop = 0, cull = 0;
    [[nodiscard]] double total() const { return insert + window + build + solve + write + loop + cull; }
  } ms;
};

/// Double-window optimisation: keeps the SLAM graph  (thesis 6.2, 6.4.1).
///
/// Nobody else changes the graph. Single-threaded; starts no threads; the same calls give the same graph bit
/// for bit. A round costs the same whatever the size of the map, unless a window is unbounded.
class Mapper {
 public:
  /// Options must be valid (see MapperOptions::invalid_reason).
  /// @param search  looks for points in images to close metric loops
  Mapper(const Rig& rig, const MapperOptions& options, PointSearch search);
  Mapper(const Rig& rig, const MapperOptions& options);

  /// Goes on with an existing graph, e.g. a loaded map, instead of the present one.
  void continue_from(const GraphSnapshot& graph);

  /// One round: inserts the proposals (in the order of their ids, which continue the graph's), adds loop
  /// constraints, optimises the double window, closes metric loops, culls.
  MapperReport step(std::span<KeyframeProposal* const> proposals, std::span<const LoopConstraint> loops = {});

  /// The private version; it becomes the next published one.
  [[nodiscard]] const GraphSnapshot& graph() const { return writer_.graph(); }
  /// O(1) whatever the size of the map.
  [[nodiscard]] GraphSnapshot publish() { return writer_.publish(); }

  /// Takes over poses that were optimised beside the mapper, for keyframes outside of the double window:
  /// inside, poses are more accurate, and the tracker relies on them. All are moved together, so that the
  /// reference keyframe stays where it is; if the update lacks it, the nearest keyframe of the window that
  /// the update has. To be followed by a step.
  /// @return keyframes moved
  int take_pose_graph(const PoseGraphUpdate& update);

  /// Before a loop of another scale is added: keyframes move into one unit (apply_similarities). To be
  /// followed by a step.
  /// @return what has changed its unit
  std::vector<KeyframeScaling> take_similarities(const SimilarityUpdate& update);

  /// Makes all poses agree globally, e.g. at the end of a run. Cost grows with the map.
  PoseGraphReport optimise_all_poses();

  /// Bundle adjustment of everything, for the end of a run (adjust_all_components), where it helps: with one
  /// camera, whose unit nothing else holds, and after a loop by appearance, which a pose graph alone has
  /// spread. Elsewhere the windows have adjusted what there is. All poses must agree (optimise_all_poses).
  /// Cost grows with the map.
  GlobalAdjustmentReport adjust_all();

  [[nodiscard]] const DoubleWindow& window() const { return window_; }
  [[nodiscard]] const MapperOptions& options() const { return options_; }

 private:
  void insert(const KeyframeProposal& proposal, MapperReport& report);
  void add_loop(const LoopConstraint& loop, MapperReport& report);
  void form_windows(MapperReport& report);
  void optimise(MapperReport& report);
  void leave_inner_window(MapperReport& report);

  void remove_outliers(MapperReport& report);
  void close_metric_loops(std::span<KeyframeProposal* const> proposals, MapperReport& report);
  void cull(MapperReport& report);

  Rig rig_;
  MapperOptions options_;
  GraphWriter writer_;
  WindowBuilder builder_;
  WindowSolver solver_;
  MetricLoopCloser metric_loops_;
  PointCuller point_culler_;

  DoubleWindow window_;       ///< of the last round
  DoubleWindow next_window_;  ///< being formed
  bool loop_closed_ = false;  ///< by appearance
  int joined_ = 0;            ///< keyframes, by similarities that no round has reported yet
  IdMap consistent_;          ///< keyframes whose absolute poses agree: the last window and what joined since
  std::vector<KeyframeId> inserted_;  ///< in this round
  SelectionScratch selection_;
  IdMap counts_;
  std::vector<WindowBuilder::Outlier> outliers_;
};

}  // namespace twofold
