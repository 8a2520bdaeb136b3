#pragma once

#include "graph/graph_writer.hpp"
#include "graph/id_map.hpp"
#include "graph/keyframe_proposal.hpp"
#include "mapping/double_window.hpp"
#include "mapping/edges.hpp"
#include "mapping/options.hpp"

namespace twofold {

struct InsertionReport {
  int observations = 0;          ///< accepted
  int dropped_observations = 0;  ///< of points that are unknown or culled
  int new_points = 0;
  int edges = 0;
};

/// Adding a keyframe and registering it locally  (thesis 6.2.6). The new keyframe becomes the reference.
///
/// Its pose hangs on the present pose of the proposal's reference (through its replacement, if that was
/// culled in the meantime). Edges go to the keyframes of `consistent` that share at least min_covisible
/// points with it, at least one to its strongest neighbour there or to the proposal's reference, so that the
/// graph stays connected. `consistent` holds the keyframes whose absolute poses agree with one another; the
/// new keyframe is added. If the proposal's reference is not among them, the set is first reduced to the
/// reference.
InsertionReport insert_keyframe(GraphWriter& writer, const KeyframeProposal& proposal, int min_covisible,
                                IdMap& consistent, IdMap& counts);

/// Keeps a pose that was measured as a whole (KeyframeProposal::pose_information) as an edge with a
/// constraint of its own, unless points enough tie the keyframe to its reference. To be called after
/// insert_keyframe.
/// @return whether there is such an edge
bool keep_measured_pose(GraphWriter& writer, const KeyframeProposal& proposal, const Rig& rig,
                        const MapperOptions& options);

/// Second half of local registration, once all poses of the window agree: edges to keyframes of the double
/// window that share at least min_covisible points with `id` but were not in `consistent` when it was
/// inserted. Returns the number of edges added.
int register_in_window(GraphWriter& writer, KeyframeId id, const DoubleWindow& window, int min_covisible,
                       IdMap& counts);

}  // namespace twofold
