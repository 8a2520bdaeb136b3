#include "filters/anchored_views.hpp"

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <algorithm>
#include <limits>

#include "filters/inverse_depth_filter.hpp"

namespace twofold {
namespace {

constexpr double kLeastGain = 1e-6;  // of the squared whitened error: the minimum is reached
constexpr int kMaxAttempts = 8;      // dampings tried for one step
constexpr double kImpossible = std::numeric_limits<double>::infinity();

}  // namespace

/// Normal equations, points apart from poses: [D_j  E_j; E_j^T  C].
struct AnchoredViews::Equations {
  using Coupling = Eigen::Matrix<double, 3, Eigen::Dynamic>;
  std::vector<Matrix3> D;
  std::vector<Coupling> E;
  std::vector<Vector3> g_points;
  Eigen::MatrixXd C;
  Eigen::VectorXd g_poses;

  /// Step with H + damping (diag H + I): multiplicative, plus a floor for depths nobody has measured yet and
  /// for the scale.
  bool solve(double damping, Eigen::VectorXd& poses_step, std::vector<Vector3>& points_step) const {
    Eigen::MatrixXd S = C;
    S.diagonal() += damping * (C.diagonal().array() + 1).matrix();
    Eigen::VectorXd rhs = g_poses;
    std::vector<Matrix3> inverse(D.size());
    for (std::size_t j = 0; j < D.size(); ++j) {
      Matrix3 damped = D[j];
      damped.diagonal() += damping * (D[j].diagonal().array() + 1).matrix();
      inverse[j] = damped.inverse();
      const Coupling gain = inverse[j] * E[j];
      S.noalias() -= E[j].transpose() * gain;
      rhs.noalias() -= gain.transpose() * g_points[j];
    }
    const Eigen::LLT<Eigen::MatrixXd> llt(S);
    if (llt.info() != Eigen::Success) return false;
    poses_step = llt.solve(rhs);
    points_step.resize(D.size());
    for (std::size_t j = 0; j < D.size(); ++j) {
      points_step[j] = inverse[j] * (g_points[j] - E[j] * poses_step);
    }
    return poses_step.allFinite();
  }
};

double AnchoredViews::cost() const {
  const double weight = 1 / (rig.noise.sigma_px * rig.noise.sigma_px);
  const int rows = rig.kind == SensorKind::kMono ? 2 : 3;
  double chi2 = 0;
  for (const Point& point : points) {
    const Vector3 x = point.psi - point.psi_prior;
    chi2 += x.dot(point.prior * x);
  }
  for (const View& view : views) {
    for (const SeenPoint& seen : view.seen) {
      const auto p = project_inverse_depth(rig, view.T_c_a, points[static_cast<std::size_t>(seen.point)].psi);
      if (!p) return kImpossible;
      chi2 += weight * (seen.z - p->z_hat).head(rows).squaredNorm();
    }
  }
  return chi2;
}

bool AnchoredViews::linearise(Equations& equations) const {
  const double weight = 1 / (rig.noise.sigma_px * rig.noise.sigma_px);
  const int rows = rig.kind == SensorKind::kMono ? 2 : 3;
  const auto size = static_cast<Eigen::Index>(6 * views.size());
  equations.C.setZero(size, size);
  equations.g_poses.setZero(size);
  equations.D.clear();
  equations.g_points.clear();
  equations.E.assign(points.size(), Equations::Coupling::Zero(3, size));
  for (const Point& point : points) {
    equations.D.push_back(point.prior);
    equations.g_points.emplace_back(-point.prior * (point.psi - point.psi_prior));
  }
  for (std::size_t v = 0; v < views.size(); ++v) {
    const auto pose = static_cast<Eigen::Index>(6 * v);
    for (const SeenPoint& seen : views[v].seen) {
      const auto j = static_cast<std::size_t>(seen.point);
      const auto p = project_inverse_depth(rig, views[v].T_c_a, points[j].psi);
      if (!p) return false;
      const Eigen::VectorXd d = (seen.z - p->z_hat).head(rows);
      const Eigen::Matrix<double, Eigen::Dynamic, 6, 0, 3, 6> J_T = p->J_camera.topRows(rows);
      const Eigen::Matrix<double, Eigen::Dynamic, 3, 0, 3, 3> J_psi = p->J_psi.topRows(rows);
      equations.C.block<6, 6>(pose, pose) += weight * J_T.transpose() * J_T;
      equations.E[j].middleCols<6>(pose) += weight * J_psi.transpose() * J_T;
      equations.D[j] += weight * J_psi.transpose() * J_psi;
      equations.g_poses.segment<6>(pose) += weight * J_T.transpose() * d;
      equations.g_points[j] += weight * J_psi.transpose() * d;
    }
  }
  return true;
}

bool AnchoredViews::minimise(int max_iterations) {
  double current = cost(), damping = 1e-6;
  Equations equations;
  Eigen::VectorXd poses_step;
  std::vector<Vector3> points_step;
  for (int iteration = 0; iteration < max_iterations && linearise(equations); ++iteration) {
    const AnchoredViews before = *this;
    double next = kImpossible;
    for (int attempt = 0; attempt < kMaxAttempts; ++attempt) {
      if (equations.solve(damping, poses_step, points_step)) {
        move(poses_step, points_step);
        next = cost();
      }
      if (next <= current) break;
      *this = before;
      damping = std::max(10 * damping, 1e-4);
    }
    if (!(next <= current)) break;
    const double gain = current - next;
    current = next;
    damping = std::max(0.1 * damping, 1e-12);
    if (gain < kLeastGain) break;
  }
  return std::isfinite(current);
}

void AnchoredViews::move(const Eigen::VectorXd& poses_step, const std::vector<Vector3>& points_step) {
  for (std::size_t v = 0; v < views.size(); ++v) {
    views[v].T_c_a = SE3::exp(poses_step.segment<6>(static_cast<Eigen::Index>(6 * v))) * views[v].T_c_a;
  }
  for (std::size_t j = 0; j < points.size(); ++j) points[j].psi += points_step[j];
}

bool AnchoredViews::normalise_scale() {
  const double length = views.front().T_c_a.translation().norm();
  if (!(length > 1e-9)) return false;
  for (View& view : views) view.T_c_a.translation() /= length;
  for (Point& point : points) point.psi.z() *= length;
  return true;
}

Eigen::MatrixXd AnchoredViews::information() const {
  Equations equations;
  if (!linearise(equations)) return {};
  const auto all_points = static_cast<Eigen::Index>(3 * points.size());
  const auto poses = static_cast<Eigen::Index>(6 * views.size());
  Eigen::MatrixXd H = Eigen::MatrixXd::Zero(all_points + poses, all_points + poses);
  for (std::size_t j = 0; j < points.size(); ++j) {
    const auto at = static_cast<Eigen::Index>(3 * j);
    H.block<3, 3>(at, at) = equations.D[j];
    H.block(at, all_points, 3, poses) = equations.E[j];
    H.block(all_points, at, poses, 3) = equations.E[j].transpose();
  }
  H.bottomRightCorner(poses, poses) = equations.C;
  return H;
}

}  // namespace twofold
