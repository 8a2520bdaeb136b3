#include "graph/point_covariance.hpp"

#include <Eigen/Cholesky>

namespace twofold {

std::optional<Matrix3> point_covariance(const Rig& rig, const GraphSnapshot& graph, PointId id) {
  const Vector3 x_w = graph.position(id);
  Matrix3 information = Matrix3::Zero();
  for (const KeyframeId observer : *graph.point(id).observers) {
    const Keyframe& keyframe = graph.keyframe(observer);
    const Observation* seen = find_observation(keyframe, id);
    const Vector3 x_k = keyframe.T_k_w * x_w;
    if (seen == nullptr || !in_front_of_camera(x_k)) continue;
    const Matrix3 J = rig.project_jacobian(x_k) * keyframe.T_k_w.rotation();
    const Vector3 weight = rig.information(seen->pixel, seen->level).cast<double>();
    information += J.transpose() * weight.asDiagonal() * J;
  }
  const Eigen::LDLT<Matrix3> factor(information);
  if (factor.info() != Eigen::Success || !(factor.vectorD().minCoeff() > 0)) return std::nullopt;
  return Matrix3(factor.solve(Matrix3::Identity()));
}

}  // namespace twofold
