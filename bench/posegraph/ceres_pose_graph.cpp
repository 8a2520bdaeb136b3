#include "bench/posegraph/ceres_pose_graph.hpp"

#include <ceres/ceres.h>

#include <Eigen/Eigenvalues>
#include <algorithm>

namespace twofold::bench {
namespace {

/// S with S^T S = information.
template <class Matrix>
Matrix square_root(const Matrix& information) {
  const Eigen::SelfAdjointEigenSolver<Matrix> eigen(information);
  return eigen.eigenvalues().cwiseMax(0).cwiseSqrt().asDiagonal() * eigen.eigenvectors().transpose();
}

/// Residual of Z^-1 X_i^-1 X_j, Z = X_i^-1 X_j as measured.
struct SpatialError {
  Eigen::Quaterniond q_z;
  Vector3 t_z;
  Matrix6 sqrt_information;

  template <class T>
  bool operator()(const T* q_i_data, const T* t_i_data, const T* q_j_data, const T* t_j_data,
                  T* residual) const {
    using Vec3 = Eigen::Matrix<T, 3, 1>;
    using Quat = Eigen::Quaternion<T>;
    const Eigen::Map<const Quat> q_i(q_i_data), q_j(q_j_data);
    const Eigen::Map<const Vec3> t_i(t_i_data), t_j(t_j_data);
    const Quat q_z_inv = q_z.conjugate().template cast<T>();
    const Vec3 t_ij = q_i.conjugate() * (t_j - t_i);
    const Quat q = q_z_inv * (q_i.conjugate() * q_j);
    Eigen::Matrix<T, 6, 1> e;
    e.template head<3>() = q_z_inv * (t_ij - t_z.template cast<T>());
    e.template tail<3>() = (q.w() < T(0) ? T(-2) : T(2)) * q.vec();
    Eigen::Map<Eigen::Matrix<T, 6, 1>> r(residual);
    r = sqrt_information.template cast<T>() * e;
    return true;
  }
};

struct PlanarError {
  double angle_z;
  Vector2 t_z;
  Matrix3 sqrt_information;

  template <class T>
  bool operator()(const T* x_i, const T* x_j, T* residual) const {
    using std::atan2, std::cos, std::sin;
    const T dx = x_j[0] - x_i[0], dy = x_j[1] - x_i[1];
    const T c = cos(x_i[2]), s = sin(x_i[2]);
    const T ex = c * dx + s * dy - t_z.x(), ey = -s * dx + c * dy - t_z.y();
    const double cz = std::cos(angle_z), sz = std::sin(angle_z);
    const T angle = x_j[2] - x_i[2] - angle_z;
    Eigen::Matrix<T, 3, 1> e(cz * ex + sz * ey, -sz * ex + cz * ey, atan2(sin(angle), cos(angle)));
    Eigen::Map<Eigen::Matrix<T, 3, 1>> r(residual);
    r = sqrt_information.template cast<T>() * e;
    return true;
  }
};

class Observer : public ceres::IterationCallback {
 public:
  explicit Observer(const std::function<void(double)>& on_cost) : on_cost_(on_cost) {}
  ceres::CallbackReturnType operator()(const ceres::IterationSummary& summary) override {
    if (on_cost_ && summary.step_is_successful) on_cost_(2 * summary.cost);
    return ceres::SOLVER_CONTINUE;
  }

 private:
  const std::function<void(double)>& on_cost_;
};

CeresSummary run(ceres::Problem& problem, const CeresOptions& options) {
  ceres::Solver::Options ceres_options;
  ceres_options.linear_solver_type = ceres::SPARSE_NORMAL_CHOLESKY;
  ceres_options.max_num_iterations = options.max_iterations;
  ceres_options.function_tolerance = options.function_tolerance;
  ceres_options.num_threads = 1;
  ceres_options.logging_type = ceres::SILENT;
  Observer observer(options.on_cost);
  ceres_options.callbacks.push_back(&observer);
  ceres::Solver::Summary summary;
  ceres::Solve(ceres_options, &problem, &summary);
  return {2 * summary.initial_cost, 2 * summary.final_cost, static_cast<int>(summary.iterations.size()) - 1};
}

}  // namespace

CeresSummary solve_with_ceres(PoseGraph<SE3>& graph, const CeresOptions& options) {
  std::vector<Eigen::Quaterniond> q;
  std::vector<Vector3> t;
  for (const SE3& T : graph.poses) {
    const SE3 X = T.inverse();
    q.push_back(X.so3().quaternion());
    t.push_back(X.translation());
  }
  ceres::Problem problem;
  auto* manifold = new ceres::EigenQuaternionManifold;
  for (std::size_t i = 0; i < q.size(); ++i) {
    problem.AddParameterBlock(q[i].coeffs().data(), 4, manifold);
    problem.AddParameterBlock(t[i].data(), 3);
  }
  for (const auto& c : graph.constraints) {
    const SE3 Z = c.T_j_i.inverse();
    auto* error = new SpatialError{Z.so3().quaternion(), Z.translation(), square_root(c.information)};
    problem.AddResidualBlock(new ceres::AutoDiffCostFunction<SpatialError, 6, 4, 3, 4, 3>(error), nullptr,
                             q[c.i].coeffs().data(), t[c.i].data(), q[c.j].coeffs().data(), t[c.j].data());
  }
  problem.SetParameterBlockConstant(q[std::max(graph.origin, 0)].coeffs().data());
  problem.SetParameterBlockConstant(t[std::max(graph.origin, 0)].data());
  const CeresSummary summary = run(problem, options);
  for (std::size_t i = 0; i < q.size(); ++i) graph.poses[i] = SE3(SO3(q[i]), t[i]).inverse();
  return summary;
}

CeresSummary solve_with_ceres(PoseGraph<SE2>& graph, const CeresOptions& options) {
  std::vector<Vector3> x;
  for (const SE2& T : graph.poses) {
    const SE2 X = T.inverse();
    x.emplace_back(X.translation().x(), X.translation().y(), X.angle());
  }
  ceres::Problem problem;
  for (Vector3& pose : x) problem.AddParameterBlock(pose.data(), 3);
  for (const auto& c : graph.constraints) {
    const SE2 Z = c.T_j_i.inverse();
    auto* error = new PlanarError{Z.angle(), Z.translation(), square_root(c.information)};
    problem.AddResidualBlock(new ceres::AutoDiffCostFunction<PlanarError, 3, 3, 3>(error), nullptr,
                             x[c.i].data(), x[c.j].data());
  }
  problem.SetParameterBlockConstant(x[std::max(graph.origin, 0)].data());
  const CeresSummary summary = run(problem, options);
  for (std::size_t i = 0; i < x.size(); ++i) graph.poses[i] = SE2(x[i].z(), x[i].head<2>()).inverse();
  return summary;
}

}  // namespace twofold::bench
