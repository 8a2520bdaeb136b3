#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <utility>
#include <vector>

#include "camera/rig.hpp"
#include "evaluation/trajectory.hpp"
#include "graph/snapshot.hpp"
#include "io/files/ply.hpp"
#include "twofold/map.hpp"

namespace twofold {

/// Keyframes that were not culled, of all parts.
[[nodiscard]] std::size_t live_keyframes(const GraphSnapshot& graph);

/// Poses of the keyframes that were not culled, of one part of the map.
[[nodiscard]] Trajectory keyframe_trajectory(const GraphSnapshot& graph, KeyframeId part);

/// The same in two lists: first those that were in the map that the run went on with, whose times are of
/// other recordings, then the run's own.
/// @param loaded  keyframes of that map, culled ones included, which have the first ids
[[nodiscard]] std::pair<Trajectory, Trajectory> loaded_and_own_keyframes(const GraphSnapshot& graph,
                                                                         KeyframeId part,
                                                                         std::uint32_t loaded);

/// All that is known of the points. O(their observations).
[[nodiscard]] std::vector<MapSnapshot::Point> points_with_covariance(const Rig& rig,
                                                                     const GraphSnapshot& graph);

/// Those of one part of the map, in the grey of their corner; they name lines of keyframe_trajectory.
[[nodiscard]] std::vector<PlyPoint> map_points(const std::vector<MapSnapshot::Point>& points,
                                               const GraphSnapshot& graph, KeyframeId part);

/// A line for each edge of the part: two keyframes by their places in keyframe_trajectory, the points that
/// both see, and "covisible" or "marginalised". Ascending.
[[nodiscard]] std::string edge_list(const GraphSnapshot& graph, KeyframeId part);

/// The pose graph in g2o's text form: VERTEX_SE3:QUAT with T_w_k, EDGE_SE3:QUAT with T_i_j of each edge and
/// an information that is the edge's weight (points that both keyframes see, at least 1) times the identity:
/// metres and radians weigh alike, and no standard deviation can be read off it. The oldest keyframe is
/// fixed.
[[nodiscard]] std::string g2o_text(const GraphSnapshot& graph);

}  // namespace twofold
