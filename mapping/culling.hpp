#pragma once

#include <span>
#include <vector>

#include "camera/rig.hpp"
#include "graph/graph_writer.hpp"
#include "mapping/double_window.hpp"
#include "mapping/options.hpp"
#include "mapping/window_builder.hpp"

namespace twofold {

/// Removes observations (sorted by keyframe, then point), and the points that are left with fewer than two
/// observers or that their anchor no longer observes. Returns the number of points culled.
int remove_outlier_observations(GraphWriter& writer, std::span<const WindowBuilder::Outlier> outliers);

/// A keyframe is redundant when `redundant_share` of its points are seen by at least `redundant_observers`
/// other keyframes on the same or a finer pyramid level. One without points, as a depth camera makes them
/// before bare walls, is not: nothing says that others see the same.
[[nodiscard]] bool is_redundant(const GraphSnapshot& graph, KeyframeId id, const CullingOptions& options);

/// Takes a keyframe out of the graph. Its strongest neighbour becomes its replacement. Neighbours that would
/// lose touch with the replacement get an edge to it, composed along the culled keyframe, so that the graph
/// stays connected; points left with fewer than two observers are culled. Returns the number of points
/// culled.
/// @param window  whose absolute poses agree with one another; to a replacement outside, the edge tells
int remove_keyframe(GraphWriter& writer, KeyframeId id, const DoubleWindow& window = {});

/// Culls redundant keyframes of the inner window, newest first, so that what is already mapped stays and
/// moving in a mapped place does not grow the map.
/// @param inserted  keyframes that this round inserted: a mapper that is behind inserts several, and must not
///                  fall behind with culling as well
/// @return the keyframes culled
std::vector<KeyframeId> cull_redundant_keyframes(GraphWriter& writer, const DoubleWindow& window,
                                                 const CullingOptions& options, std::size_t inserted,
                                                 int& culled_points);

/// Culls points that add nothing: seen from two keyframes only, and not seen again although keyframe after
/// keyframe had them well in view.
class PointCuller {
 public:
  PointCuller(const Rig& rig, const CullingOptions& options) : rig_(rig), options_(options) {}

  /// Judges the given points by the newest keyframe. Returns the number of points culled.
  int cull(GraphWriter& writer, KeyframeId newest, std::span<const PointId> points) const;

 private:
  Rig rig_;
  CullingOptions options_;
};

}  // namespace twofold
