#pragma once

#include <map>
#include <vector>

#include "experiments/double_window/loop_optimisation.hpp"
#include "mapping/mapper.hpp"

namespace twofold::bench {

/// The mapper's round for one camera whose scale drifts  (thesis 6.2.7): made of the same parts as Mapper,
/// and of what that one leaves out.
///
/// Poses are members of Sim(3) whose scale stays fixed, save that a pose set along relative ones (eq. 6.3)
/// takes over the scale of the pose it is set from, times that of the edge, which is not one across a large
/// loop. A camera does not see the scale of its own frame: pose (s, R, t) is kept as (R, t / s), and lengths
/// in that frame, of points and of edges, are divided by s. Work follows the window's size, not the map's.
///
/// A loop that lies within the window as a whole would break somewhere in it: there the misfit is spread over
/// all poses and their scales instead, as in chapter 5 (optimise_loop).
class DriftMapper {
 public:
  DriftMapper(const Rig& rig, const MapperOptions& options, LoopGroup group = LoopGroup::kSim3);

  /// Inserts a keyframe and optimises the double window around it.
  MapperReport step(const KeyframeProposal& proposal);
  /// Adds a loop from the reference and optimises the double window, which now extends across it: whoever
  /// tracks the next keyframe takes it that the poses near the reference agree.
  /// @param copies  points that the map has twice, around `from` and around `to`: they become one
  MapperReport close(SimilarityConstraint loop, std::span<const PointCopies> copies);

  [[nodiscard]] const GraphSnapshot& graph() const { return writer_.graph(); }
  [[nodiscard]] const DoubleWindow& window() const { return window_; }

 private:
  /// Scales of the two keyframes (ascending) when an edge's relative pose was stored.
  struct EdgeScales {
    double first = 1, second = 1;
  };
  using EdgeKey = std::pair<KeyframeId, KeyframeId>;

  [[nodiscard]] double& scale(KeyframeId id);
  [[nodiscard]] EdgeScales edge_scales(KeyframeId a, KeyframeId b) const;  ///< of a, of b
  void store_edge_scales(KeyframeId a, KeyframeId b);
  void store_window_scales();
  void unite(std::span<const PointCopies> copies);
  void spread(const SimilarityConstraint& loop);
  void propagate_scale(const DoubleWindow& window);
  void rescale_keyframe(KeyframeId id, double new_scale);
  void rescale_edges(KeyframeId id);
  void rescale_edge(KeyframeId id, const Edge& edge);
  void move_window(MapperReport& report);
  void optimise(MapperReport& report);

  MapperOptions options_;
  LoopGroup group_;
  GraphWriter writer_;
  WindowBuilder builder_;
  WindowSolver solver_;
  DoubleWindow window_, next_window_;
  IdMap consistent_, counts_;
  SelectionScratch selection_;
  std::vector<KeyframeId> changed_;            ///< keyframes with new measurements, to be registered
  std::vector<double> scale_;                  ///< by keyframe: lengths in its frame have been divided by it
  std::map<EdgeKey, EdgeScales> edge_scales_;  ///< where they are not both one
};

}  // namespace twofold::bench
