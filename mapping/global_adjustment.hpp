#pragma once

#include <optional>

#include "camera/rig.hpp"
#include "estimation/focal_length.hpp"
#include "graph/graph_writer.hpp"
#include "mapping/options.hpp"

namespace twofold {

struct GlobalAdjustmentReport {
  int components = 0;  ///< of the graph, each adjusted on its own
  int keyframes = 0;
  int points = 0;
  int observations = 0;
  int outliers = 0;         ///< observations removed
  int too_large = 0;        ///< components left as they were: more keyframes than max_keyframes
  double initial_cost = 0;  ///< of the first round, all components
  /// Of one camera, as the reference keyframe's component shows it, if it does; sigma includes
  /// GlobalAdjustmentOptions::focal_sigma. Poses and points are those of the rig's focal length nevertheless.
  std::optional<FocalLengthEstimate> focal_length;
  double final_cost = 0;  ///< of the last one; fewer observations than initial_cost where there are outliers
};

/// Bundle adjustment of whole maps: eq. 6.4 with all keyframes of a connected component in the inner window,
/// so that the points speak wherever two keyframes share enough of them. Their poses must agree
/// (optimise_all_components). A component's root stays where it is, that of the reference keyframe's being
/// the reference. Afterwards every edge between adjusted keyframes has the adjusted relative pose as its
/// constraint, so that who goes on with the map starts from there. Cost grows with the map.
GlobalAdjustmentReport adjust_all_components(GraphWriter& writer, const Rig& rig,
                                             const MapperOptions& options);

}  // namespace twofold
