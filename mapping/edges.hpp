#pragma once

#include <vector>

#include "camera/rig.hpp"
#include "graph/graph_writer.hpp"
#include "graph/id_map.hpp"
#include "mapping/options.hpp"

namespace twofold {

struct Covisible {
  KeyframeId id = kNoKeyframe;
  int points = 0;  ///< seen from both keyframes
};

/// All keyframes that share points with `id`, ascending. `counts` is scratch; `result` is refilled.
void covisible_keyframes(const GraphSnapshot& graph, KeyframeId id, IdMap& counts,
                         std::vector<Covisible>& result);

/// visit(observation by a, observation by b) for each point seen from both keyframes, ascending.
template <class Visit>
void for_shared_points(const Keyframe& a, const Keyframe& b, Visit&& visit) {
  auto i = a.observations->begin(), j = b.observations->begin();
  while (i != a.observations->end() && j != b.observations->end()) {
    if (i->point < j->point) {
      ++i;
    } else if (j->point < i->point) {
      ++j;
    } else {
      visit(*i++, *j++);
    }
  }
}

/// w_ij: number of points seen from both keyframes.
[[nodiscard]] int shared_points(const Keyframe& a, const Keyframe& b);

/// Adds or updates the edge without a constraint of its own: its relative pose is that of the two absolute
/// poses, which must agree with each other.
void link(GraphWriter& writer, KeyframeId from, KeyframeId to, int weight);

/// Adds or updates the edge with the relative pose as its constraint  (6.2.3, 6.8).
void link_marginalised(GraphWriter& writer, KeyframeId from, KeyframeId to, int weight, const SE3& T_to_from);

/// Lambda of an edge, eq. 6.2.
///
/// Ideal precision: w points measured with sigma in both frames shift by f dw pixels when the frame turns by
/// dw and by f/d dt when it moves by dt, so lambda_rot = f / (sqrt(2) sigma) and lambda_trans = lambda_rot /
/// d  [1/m] per point, were rotation and translation told apart for free. With parallax p = |t| / d, 1/d =
/// p / |t|: the thesis' "proportional to the parallax" per unit of baseline. Far less is left of that: a
/// point counts again in every pair of frames that see it, and what it says about rotation and translation
/// is correlated. On the spiral of 6.5.1 shares of 0.05 to 0.15 bring the double window within a few percent
/// of bundle adjustment; shares of 0.3 cost a sixth of the local accuracy, and with softer ones W2 drifts.
[[nodiscard]] Matrix6 edge_information(const Keyframe& from, const Keyframe& to, const Edge& edge,
                                       const Rig& rig, const EdgeInformationOptions& options);

/// Weight of an edge whose relative pose is known with `information` (left perturbation): of the points that
/// would tell as much in every direction, which means in the one it tells least about.
[[nodiscard]] int weight_of_measured_pose(const Matrix6& information, const Keyframe& from,
                                          const Keyframe& to, const Rig& rig,
                                          const EdgeInformationOptions& options);

}  // namespace twofold
