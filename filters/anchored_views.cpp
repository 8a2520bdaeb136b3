#include "filters/anchored_views.hpp"

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <algorithm>
#include <limits>

#include "camera/pinhole.hpp"
#include "estimation/levenberg_marquardt.hpp"
#include "geometry/so3.hpp"

namespace twofold {
namespace {

constexpr int kMaxAttempts = 8;  // dampings tried for one step
constexpr double kImpossible = std::numeric_limits<double>::infinity();

/// project_inverse_depth of many points in one view, without what an adjustment has no use for: h = R (x/z,
/// y/z, 1) + q t is linear in psi.
class ViewProjection {
 public:
  ViewProjection(const Rig& rig, const SE3& T_c_a) : rig_(rig) {
    const Matrix3 R = T_c_a.rotation();
    linear_ << R.leftCols<2>(), T_c_a.translation();
    constant_ = R.col(2);
  }
  [[nodiscard]] Vector3 ray(const Vector3& psi) const { return linear_ * psi + constant_; }
  [[nodiscard]] Vector3 pixel(const Vector3& h, const Vector3& psi) const {
    const Vector2 uv = rig_.camera.project(h);
    return {uv.x(), uv.y(), uv.x() - rig_.camera.fx * rig_.baseline * psi.z() / h.z()};
  }
  /// Of the pixel, by h with psi as it is.
  [[nodiscard]] Matrix3 by_ray(const Vector3& h, const Vector3& psi) const {
    const double a = rig_.camera.fx / h.z(), c = rig_.camera.fy / h.z(), u = h.x() / h.z();
    Matrix3 J;
    J << a, 0, -a * u,             //
        0, c, -c * h.y() / h.z(),  //
        a, 0, -a * (u - rig_.baseline * psi.z() / h.z());
    return J;
  }
  /// Of the pixel, by psi; of its first rows when J_h has no more.
  template <int kRows>
  [[nodiscard]] Eigen::Matrix<double, kRows, 3> by_psi(const Vector3& h,
                                                       const Eigen::Matrix<double, kRows, 3>& J_h) const {
    Eigen::Matrix<double, kRows, 3> J = J_h * linear_;
    if constexpr (kRows == 3) J(2, 2) -= rig_.camera.fx * rig_.baseline / h.z();
    return J;
  }

 private:
  const Rig& rig_;
  Matrix3 linear_;
  Vector3 constant_;
};

}  // namespace

/// Normal equations, points apart from poses: [D_j  E_j; E_j^T  C]. The E_j^T stand side by side.
struct AnchoredViews::Equations {
  std::vector<Matrix3> D;
  Eigen::MatrixXd E_T, G_T;  ///< one column block of three a point
  std::vector<Vector3> g_points;
  Eigen::MatrixXd C, S;
  Eigen::VectorXd g_poses, rhs;
  std::vector<Matrix3> inverse;

  /// Step with H + damping (diag H + I): multiplicative, plus a floor for depths nobody has measured yet and
  /// for the scale.
  bool solve(double damping, Eigen::VectorXd& poses_step, std::vector<Vector3>& points_step) {
    rhs = g_poses;
    inverse.resize(D.size());
    G_T.resizeLike(E_T);
    for (std::size_t j = 0; j < D.size(); ++j) {
      Matrix3 damped = D[j];
      damped.diagonal() += damping * (D[j].diagonal().array() + 1).matrix();
      inverse[j] = damped.inverse();
      const auto at = static_cast<Eigen::Index>(3 * j);
      G_T.middleCols<3>(at).noalias() = E_T.middleCols<3>(at).lazyProduct(inverse[j]);
      rhs.noalias() -= G_T.middleCols<3>(at).lazyProduct(g_points[j]);
    }
    S = C;
    S.diagonal() += damping * (C.diagonal().array() + 1).matrix();
    S.noalias() -= G_T * E_T.transpose();
    const Eigen::LLT<Eigen::MatrixXd> llt(S);
    if (llt.info() != Eigen::Success) return false;
    poses_step = llt.solve(rhs);
    points_step.resize(D.size());
    for (std::size_t j = 0; j < D.size(); ++j) {
      const auto at = static_cast<Eigen::Index>(3 * j);
      points_step[j] = inverse[j] * (g_points[j] - E_T.middleCols<3>(at).transpose().lazyProduct(poses_step));
    }
    return poses_step.allFinite();
  }
};

double AnchoredViews::cost() const {
  const double weight = 1 / (rig.noise.sigma_px * rig.noise.sigma_px);
  double chi2 = 0;
  for (const Point& point : points) {
    const Vector3 x = point.psi - point.psi_prior;
    chi2 += x.dot(point.prior * x);
  }
  for (const View& view : views) {
    const ViewProjection project(rig, view.T_c_a);
    double sum = 0;
    for (const SeenPoint& seen : view.seen) {
      const Vector3& psi = points[static_cast<std::size_t>(seen.point)].psi;
      const Vector3 h = project.ray(psi);
      if (!in_front_of_camera(h)) return kImpossible;
      const Vector3 d = seen.pixel - project.pixel(h, psi);
      sum += rig.kind == SensorKind::kMono ? d.head<2>().squaredNorm() : d.squaredNorm();
    }
    chi2 += weight * sum;
  }
  return chi2;
}

template <int kRows>
bool AnchoredViews::add_view(std::size_t v, Equations& equations) const {
  const double weight = 1 / (rig.noise.sigma_px * rig.noise.sigma_px);
  const auto pose = static_cast<Eigen::Index>(6 * v);
  Matrix6 C = Matrix6::Zero();
  Vector6 g = Vector6::Zero();
  const ViewProjection project(rig, views[v].T_c_a);
  for (const SeenPoint& seen : views[v].seen) {
    const auto j = static_cast<std::size_t>(seen.point);
    const Vector3& psi = points[j].psi;
    const Vector3 h = project.ray(psi);
    if (!in_front_of_camera(h)) return false;
    const Eigen::Matrix<double, kRows, 1> d = (seen.pixel - project.pixel(h, psi)).template head<kRows>();
    const Eigen::Matrix<double, kRows, 3> J_h = project.by_ray(h, psi).template topRows<kRows>();
    Eigen::Matrix<double, kRows, 6> J_T;
    J_T << psi.z() * J_h, -J_h * hat(h);
    const Eigen::Matrix<double, kRows, 3> J_psi = project.by_psi(h, J_h);
    C += weight * J_T.transpose() * J_T;
    equations.E_T.block<6, 3>(pose, static_cast<Eigen::Index>(3 * j)) += weight * J_T.transpose() * J_psi;
    equations.D[j] += weight * J_psi.transpose() * J_psi;
    g += weight * J_T.transpose() * d;
    equations.g_points[j] += weight * J_psi.transpose() * d;
  }
  equations.C.block<6, 6>(pose, pose) += C;
  equations.g_poses.segment<6>(pose) += g;
  return true;
}

bool AnchoredViews::linearise(Equations& equations) const {
  const auto size = static_cast<Eigen::Index>(6 * views.size());
  equations.C.setZero(size, size);
  equations.g_poses.setZero(size);
  equations.D.clear();
  equations.g_points.clear();
  equations.E_T.setZero(size, static_cast<Eigen::Index>(3 * points.size()));
  for (const Point& point : points) {
    equations.D.push_back(point.prior);
    equations.g_points.emplace_back(-point.prior * (point.psi - point.psi_prior));
  }
  for (std::size_t v = 0; v < views.size(); ++v) {
    if (!(rig.kind == SensorKind::kMono ? add_view<2>(v, equations) : add_view<3>(v, equations)))
      return false;
  }
  return true;
}

bool AnchoredViews::minimise(int max_iterations, double min_gain) {
  double current = cost(), damping = 1e-6;
  Equations equations;
  Eigen::VectorXd poses_step;
  std::vector<Vector3> points_step;
  for (int iteration = 0; iteration < max_iterations && linearise(equations); ++iteration) {
    const std::vector<Point> points_before = points;
    const std::vector<SE3> poses_before = poses();
    double next = kImpossible;
    for (int attempt = 0; attempt < kMaxAttempts; ++attempt) {
      if (equations.solve(damping, poses_step, points_step)) {
        move(poses_step, points_step);
        next = cost();
      }
      if (next <= current) break;
      points = points_before;
      for (std::size_t v = 0; v < views.size(); ++v) views[v].T_c_a = poses_before[v];
      damping = raised_damping(damping, 1e-4);
    }
    if (!(next <= current)) break;
    const double gain = current - next;
    current = next;
    damping = std::max(0.1 * damping, 1e-12);
    if (gain < min_gain) break;
  }
  return std::isfinite(current);
}

std::vector<SE3> AnchoredViews::poses() const {
  std::vector<SE3> result;
  for (const View& view : views) result.push_back(view.T_c_a);
  return result;
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
  const auto all_poses = static_cast<Eigen::Index>(6 * views.size());
  Eigen::MatrixXd H = Eigen::MatrixXd::Zero(all_points + all_poses, all_points + all_poses);
  for (std::size_t j = 0; j < points.size(); ++j) {
    const auto at = static_cast<Eigen::Index>(3 * j);
    H.block<3, 3>(at, at) = equations.D[j];
    H.block(at, all_points, 3, all_poses) = equations.E_T.middleCols<3>(at).transpose();
    H.block(all_points, at, all_poses, 3) = equations.E_T.middleCols<3>(at);
  }
  H.bottomRightCorner(all_poses, all_poses) = equations.C;
  return H;
}

}  // namespace twofold
