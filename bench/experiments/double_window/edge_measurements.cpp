#include "experiments/double_window/edge_measurements.hpp"

#include <Eigen/Cholesky>
#include <cmath>

#include "camera/measurement.hpp"
#include "imaging/guided_search.hpp"
#include "mapping/edges.hpp"

namespace twofold::bench {
namespace {

constexpr double kMinShare = 1e-3;     // an edge with less than this outside of the problem says nothing
constexpr double kMinDiagonal = 1e-9;  // of a factor: below it a direction is not determined

/// What one measurement does to its point, in the world frame.
struct Pull {
  Matrix3 stiffness;
  Vector3 force;
};

std::optional<Pull> pull_of(const Rig& rig, const Keyframe& keyframe, const Observation& observation,
                            const Vector3& x_w) {
  const Vector3 x = keyframe.T_k_w * x_w;
  if (!in_front_of_camera(x)) return std::nullopt;
  const Vector3 information = rig.information(observation.pixel, observation.level).cast<double>();
  const Matrix3 J = rig.project_jacobian(x) * keyframe.T_k_w.so3().matrix();
  Vector3 r = observation.pixel.cast<double>() - rig.project(x);
  if (!weighs_right(information)) r.z() = 0;
  return Pull{J.transpose() * information.asDiagonal() * J, J.transpose() * information.cwiseProduct(r)};
}

double one_over_n(const GraphSnapshot& graph, PointId id) {
  return 1.0 / static_cast<double>(graph.point(id).observers->size());
}

/// Takes away the given share of what is said about moving along `direction` while nothing else moves.
void soften(const Vector6& direction, double taken, Matrix6& information) {
  const Vector6 force = information * direction;
  const double energy = direction.dot(force);
  if (energy > 0) information -= taken / energy * force * force.transpose();
}

}  // namespace

std::optional<EdgeMeasurements::Measured> EdgeMeasurements::measured(const GraphSnapshot& graph,
                                                                     const Rig& rig, const Keyframe& a,
                                                                     const Keyframe& b) const {
  const Matrix3 R_b_w = b.T_k_w.so3().matrix();
  Measured edge;
  edge.information.setZero();
  Vector6 tension = Vector6::Zero();
  for_shared_points(a, b, [&](const Observation& seen_a, const Observation& seen_b) {
    const Vector3 x_w = graph.position(seen_a.point);
    const auto pull_a = pull_of(rig, a, seen_a, x_w);
    const auto pull_b = pull_of(rig, b, seen_b, x_w);
    if (!pull_a || !pull_b) return;
    const double share = one_over_n(graph, seen_a.point);
    Eigen::Matrix<double, 3, 6> G;  // world frame: forces and stiffness need not be turned
    G << R_b_w.transpose(), -R_b_w.transpose() * hat(b.T_k_w * x_w);
    edge.information.noalias() += G.transpose() * (0.5 * share * (pull_a->stiffness + pull_b->stiffness)) * G;
    tension.noalias() += G.transpose() * (share * (pull_b->force - pull_a->force));
    edge.points += share;
  });
  const Eigen::LDLT<Matrix6> factor(edge.information);
  const Vector6 D = factor.vectorD();
  if (edge.points == 0 || !(D.minCoeff() > kMinDiagonal * D.maxCoeff())) return std::nullopt;
  edge.T_b_a = SE3::exp(factor.solve(tension)) * b.T_k_w * a.T_k_w.inverse();
  Vector6 longer = Vector6::Zero();
  longer.head<3>() = edge.T_b_a.translation();
  soften(longer, 1 - length_share_, edge.information);
  return edge;
}

bool EdgeMeasurements::measure(const GraphSnapshot& graph, const Rig& rig, KeyframeId from, KeyframeId to) {
  const auto key = std::minmax(from, to);
  const auto edge = measured(graph, rig, graph.keyframe(key.first), graph.keyframe(key.second));
  if (edge) {
    measured_.insert_or_assign(key, *edge);
  } else {
    measured_.erase(key);
  }
  return edge.has_value();
}

std::optional<EdgeMeasurements::Constraint> EdgeMeasurements::constraint(const GraphSnapshot& graph,
                                                                         KeyframeId from, KeyframeId to,
                                                                         const IdMap& position) const {
  const auto at = measured_.find(std::minmax(from, to));
  if (at == measured_.end()) return std::nullopt;
  const Measured& edge = at->second;
  double outside = 0;
  for_shared_points(graph.keyframe(from), graph.keyframe(to), [&](const Observation& seen, const auto&) {
    if (position.find(seen.point) <= 0) outside += one_over_n(graph, seen.point);
  });
  const double share = outside / edge.points < kMinShare ? 0 : outside / edge.points;
  if (from < to) return Constraint{edge.T_b_a, share * edge.information};
  const Matrix6 Ad = edge.T_b_a.adjoint();  // v_ba = -Ad(T_ba) v_ab
  return Constraint{edge.T_b_a.inverse(), share * Ad.transpose() * edge.information * Ad};
}

void EdgeMeasurements::forget(KeyframeId id) {
  std::erase_if(measured_,
                [&](const auto& entry) { return entry.first.first == id || entry.first.second == id; });
}

}  // namespace twofold::bench
