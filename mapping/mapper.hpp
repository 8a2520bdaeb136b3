#pragma once

#include <span>

#include "estimation/window_solver.hpp"
#include "graph/graph_writer.hpp"
#include "graph/keyframe_proposal.hpp"
#include "mapping/double_window.hpp"
#include "mapping/options.hpp"
#include "mapping/window_builder.hpp"

namespace twofold {

/// What one round did.
struct MapperReport {
  int inserted = 0;      ///< keyframes
  int inner_window = 0;  ///< keyframes in W1
  int outer_window = 0;  ///< keyframes in W2
  int points = 0;        ///< in the joint solve
  int observations = 0;
  int constraints = 0;  ///< pose-pose
  int removed_observations = 0;
  int metric_loops = 0;  ///< edges added by metric loop closure
  int culled_keyframes = 0;
  int culled_points = 0;
  SolverSummary solver;
};

/// The only writer of the SLAM graph: double-window optimisation  (thesis 6.2). Single-threaded,
/// deterministic.
class Mapper {
 public:
  /// Throws std::runtime_error for invalid options.
  Mapper(const Rig& rig, const MapperOptions& options);

  /// One round: inserts the proposals, oldest first, and optimises the double window around the newest.
  MapperReport step(std::span<KeyframeProposal* const> proposals);

  /// The graph as it stands; publish() seals it as a snapshot.
  [[nodiscard]] const GraphSnapshot& graph() const { return writer_.graph(); }
  [[nodiscard]] GraphSnapshot publish() { return writer_.publish(); }

  /// Makes the whole map consistent: relaxes all keyframe poses over all relative edges, those of the inner
  /// window as they are now. Cost grows with the map; meant for the end of a run and for saving.
  void relax_all();

 private:
  void optimise_window(MapperReport& report);
  void marginalise_edges();

  Rig rig_;
  MapperOptions options_;
  GraphWriter writer_;
  DoubleWindow window_;
  WindowBuilder builder_;
  WindowSolver solver_;
};

}  // namespace twofold
