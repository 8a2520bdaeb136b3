#pragma once

#include <vector>

#include "camera/rig.hpp"
#include "graph/graph_writer.hpp"
#include "graph/loop_constraint.hpp"
#include "graph/pose_graph_update.hpp"
#include "mapping/options.hpp"

namespace twofold {

/// Scale drift-aware loop closure  (thesis 5.3.2, 6.2.7). One camera's unit of length drifts along a large
/// loop: a pose graph over SE(3) would bend the path instead of scaling it.
///
/// The similarities of all keyframes of the part that agree best with its edges, each of scale one, and with
/// the loop: a pose graph over Sim(3), in which loop.to is fixed. If loop.from is of another part, that one
/// is moved and scaled as a whole into the world of loop.to's. Changes nothing: it runs beside the mapper,
/// which takes the result as a message (Mapper::take_similarities). Cost grows with the number of keyframes.
///
/// @param loop  between keyframes of `graph` that are not culled
[[nodiscard]] SimilarityUpdate close_over_sim3(const GraphSnapshot& graph, const LoopConstraint& loop,
                                               const Rig& rig, const MapperOptions& options);

/// How much longer everything around a keyframe has become.
struct KeyframeScaling {
  KeyframeId id = kNoKeyframe;
  double factor = 1;
};

/// Moves the keyframes, and with each all that is measured in its unit: the points anchored in it, its depth,
/// the constraints of its edges, and the culled keyframes that it stands for. Keyframes that were culled or
/// made since the update stay as they are. Cost grows with the map.
/// @return the keyframes moved
std::vector<KeyframeScaling> apply_similarities(GraphWriter& writer, const SimilarityUpdate& update);

}  // namespace twofold
