#pragma once

#include <map>
#include <optional>
#include <utility>

#include "camera/rig.hpp"
#include "graph/id_map.hpp"
#include "graph/snapshot.hpp"

namespace twofold::bench {

/// Pose-pose constraints made of measurements: what the points seen from two keyframes said about their
/// relative pose when W1 left them, in place of eq. 6.2 and of the relative pose as it had been estimated.
/// (That one stays in the graph's edge: it is the better one to set a pose along, eq. 6.3.)
///
/// At the solution, the measurement of point k in keyframe i pulls at the point with the force F_ik = J^T
/// Lambda_z r and the stiffness A_ik = J^T Lambda_z J (J = d z / d point), and sum_i F_ik = 0. To eliminate a
/// point that n keyframes see is to span springs between all pairs of them, exactly of stiffness A / n if all
/// A_ik are A, under the tension (F_j - F_i) / n, exactly whatever they are. So the edge of keyframes i and j
/// gets
///   Lambda_ji = sum_k G_k^T (A_ik + A_jk) / (2 n_k) G_k,      G_k = [I, -[x_k]x]  with x_k in frame j,
///   v = Lambda_ji^-1 sum_k G_k^T (F_jk - F_ik) / n_k,         T_ji = exp(v) T_j T_i^-1:
/// a point counts once however many edges share it, and an edge says what the two keyframes measured, not
/// what W2, whose edges shaped the estimate, had said before. Rotation and translation hang together in it as
/// the points have it.
///
/// Springs hold lengths, the points of one camera do not: the three-view terms that pairs cannot express let
/// the scale go. What an edge says about its own length is therefore reduced to a share (length_share).
///
/// For an outer window that holds all keyframes: of one that is cut off, the pairs beyond it, and with them
/// their part of the points they share, are missing.
class EdgeMeasurements {
 public:
  /// @param length_share  of what an edge says about its own length, in (0, 1]
  explicit EdgeMeasurements(double length_share) : length_share_(length_share) {}

  struct Constraint {
    SE3 T_to_from;
    Matrix6 information;  ///< of v_to_from = log(T_to_from T_from T_to^-1), tangent order (v, omega)
  };

  /// Measures the edge anew. Call it while the points of both keyframes are as the last problem left them.
  /// @param rig  with the baseline that problem was solved with
  /// @return false if the points leave the relative pose undetermined: then there is no measurement
  bool measure(const GraphSnapshot& graph, const Rig& rig, KeyframeId from, KeyframeId to);

  /// What the edge says for those of its points that are not in a problem themselves: its information times
  /// their share, zero if there are none. Nothing if there is no measurement.
  /// @param position  of points; > 0: in the problem
  [[nodiscard]] std::optional<Constraint> constraint(const GraphSnapshot& graph, KeyframeId from,
                                                     KeyframeId to, const IdMap& position) const;

  /// The edge has a constraint from elsewhere now.
  void forget(KeyframeId a, KeyframeId b) { measured_.erase(std::minmax(a, b)); }
  /// The keyframe is no more.
  void forget(KeyframeId id);
  void clear() { measured_.clear(); }

 private:
  struct Measured {
    SE3 T_b_a;
    Matrix6 information;  ///< of v_ba
    double points = 0;    ///< sum of 1 / n_k
  };

  [[nodiscard]] std::optional<Measured> measured(const GraphSnapshot& graph, const Rig& rig,
                                                 const Keyframe& a, const Keyframe& b) const;

  double length_share_;
  std::map<std::pair<KeyframeId, KeyframeId>, Measured> measured_;  ///< by (a, b), a < b
};

}  // namespace twofold::bench
