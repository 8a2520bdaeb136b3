// Joint update of the Gauss-Newton filter: algorithm 4 and eq. 4.18 - 4.21 of the thesis.
#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <limits>

#include "base/processor_time.hpp"
#include "estimation/levenberg_marquardt.hpp"
#include "experiments/why_filter/gauss_newton_filter.hpp"

namespace twofold::bench {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();

double thread_seconds() {
  return 1e-9 * static_cast<double>(thread_cpu_ns());
}

}  // namespace

/// Algorithm 4. Adds D^T Lambda_z D and D^T Lambda_z d; returns the squared whitened error, infinity when a
/// point is behind the camera.
double GaussNewtonFilter::add_measurements(const std::vector<Seen>& seen, MatrixX* Lambda, VectorX* g) const {
  const double weight = 1 / (options_.sigma_px * options_.sigma_px);
  const int rows = this->rows(), pose = pose_at();
  const bool first = options_.linearisation == Linearisation::kFirstEstimate;
  std::vector<SE3> T_c_a, T_c_a_lin;
  for (int a = 0; a <= anchor_count(); ++a) {
    T_c_a.push_back(T_c_anchor(a));
    T_c_a_lin.push_back(T_c_w_ * anchors_lin_[static_cast<std::size_t>(a)].inverse());
  }
  double chi2 = 0;
  for (const Seen& s : seen) {
    const Point& point = points_[static_cast<std::size_t>(s.point)];
    const auto a = static_cast<std::size_t>(point.anchor);
    auto p = project_inverse_depth(rig_, T_c_a[a], point.psi);
    if (!p) return kInfinity;
    const VectorX d = (s.pixel - p->z_hat).head(rows);
    chi2 += weight * d.squaredNorm();
    if (Lambda == nullptr) continue;
    if (first) p = project_inverse_depth(rig_, T_c_a_lin[a], point.psi_lin.value_or(point.psi));
    if (!p) return kInfinity;
    const int at = point_at(s.point);
    const Eigen::Matrix<double, Eigen::Dynamic, 6, 0, 3, 6> J_T = p->J_camera.topRows(rows);
    const Eigen::Matrix<double, Eigen::Dynamic, 3, 0, 3, 3> J_psi = p->J_psi.topRows(rows);
    const Matrix63 W = weight * J_T.transpose() * J_psi;
    Lambda->block<6, 6>(pose, pose) += weight * J_T.transpose() * J_T;
    Lambda->block<6, 3>(pose, at) += W;
    Lambda->block<3, 6>(at, pose) += W.transpose();
    Lambda->block<3, 3>(at, at) += weight * J_psi.transpose() * J_psi;
    g->segment<6>(pose) += weight * J_T.transpose() * d;
    g->segment<3>(at) += weight * J_psi.transpose() * d;
    if (point.anchor == 0) continue;
    const int anchor = anchor_at(point.anchor);
    const Eigen::Matrix<double, Eigen::Dynamic, 6, 0, 3, 6> J_a = p->J_anchor.topRows(rows);
    const Matrix63 W_a = weight * J_a.transpose() * J_psi;
    const Matrix6 W_T = weight * J_T.transpose() * J_a;
    Lambda->block<6, 6>(anchor, anchor) += weight * J_a.transpose() * J_a;
    Lambda->block<6, 3>(anchor, at) += W_a;
    Lambda->block<3, 6>(at, anchor) += W_a.transpose();
    Lambda->block<6, 6>(pose, anchor) += W_T;
    Lambda->block<6, 6>(anchor, pose) += W_T.transpose();
    g->segment<6>(anchor) += weight * J_a.transpose() * d;
  }
  return chi2;
}

void GaussNewtonFilter::set_mean(const Mean& mean) {
  T_c_w_ = mean.T_c_w;
  anchors_ = mean.anchors;
  points_ = mean.points;
}

void GaussNewtonFilter::move(const VectorX& delta) {
  T_c_w_ = SE3::exp(delta.tail<6>()) * T_c_w_;
  for (int a = 1; a <= anchor_count(); ++a) {
    SE3& T = anchors_[static_cast<std::size_t>(a)];
    T = SE3::exp(delta.segment<6>(anchor_at(a))) * T;
  }
  for (int j = 0; j < point_count(); ++j) {
    points_[static_cast<std::size_t>(j)].psi += delta.segment<3>(point_at(j));
  }
}

/// Phi_i (-) Phi_i-1  (4.19); zero for the current pose, which has no prior.
VectorX GaussNewtonFilter::offset(const Mean& from) const {
  VectorX x = VectorX::Zero(Lambda_.rows());
  for (int a = 1; a <= anchor_count(); ++a) {
    const auto i = static_cast<std::size_t>(a);
    x.segment<6>(anchor_at(a)) = (anchors_[i] * from.anchors[i].inverse()).log();
  }
  for (int j = 0; j < point_count(); ++j) {
    const auto i = static_cast<std::size_t>(j);
    x.segment<3>(point_at(j)) = points_[i].psi - from.points[i].psi;
  }
  return x;
}

/// Lambda += D^T Lambda_z D  (4.21).
void GaussNewtonFilter::absorb(const std::vector<Seen>& seen) {
  VectorX unused = VectorX::Zero(Lambda_.rows());
  add_measurements(seen, &Lambda_, &unused);
  // What a point knew before is linear in psi: its own anchor's measurement. From here on it is not.
  for (const Seen& s : seen) {
    Point& point = points_[static_cast<std::size_t>(s.point)];
    if (!point.psi_lin) point.psi_lin = point.psi;
  }
}

/// Levenberg-Marquardt on eq. 4.18, then the new information  (4.21).
bool GaussNewtonFilter::joint_update(const std::vector<Seen>& seen, int iterations) {
  const double start = thread_seconds();
  const MatrixX prior = Lambda_;
  const Mean before = mean();
  VectorX x = VectorX::Zero(Lambda_.rows());
  double current = add_measurements(seen, nullptr, nullptr);
  double damping = 1e-6;
  bool moved = false;
  for (int iteration = 0; iteration < iterations; ++iteration) {
    MatrixX H = prior;
    VectorX g = -(prior * x);
    add_measurements(seen, &H, &g);
    const VectorX diagonal = H.diagonal();
    bool accepted = false;
    for (int attempt = 0; attempt < 8 && !accepted; ++attempt) {
      // Multiplicative damping plus a floor: a depth nobody has measured yet has a zero on the diagonal.
      H.diagonal() = diagonal + damping * (diagonal + VectorX::Constant(diagonal.size(), 1.0));
      MatrixX factor = H;
      const Eigen::LLT<Eigen::Ref<MatrixX>> llt(factor);
      const Mean old = mean();
      double next = kInfinity;
      VectorX x_next;
      if (llt.info() == Eigen::Success) {
        const VectorX delta = llt.solve(g);
        move(delta);
        x_next = offset(before);
        if (delta.allFinite()) next = x_next.dot(prior * x_next) + add_measurements(seen, nullptr, nullptr);
      }
      accepted = next <= current || (!std::isfinite(current) && std::isfinite(next));
      if (accepted) {
        current = next;
        x = x_next;
        moved = true;
        damping = std::max(0.1 * damping, 1e-12);
      } else {
        set_mean(old);
        damping = raised_damping(damping, 1e-4);
      }
    }
    if (!accepted) break;
  }
  if (std::isfinite(current)) absorb(seen);
  joint_seconds_ = thread_seconds() - start;
  return std::isfinite(current) && (moved || iterations == 0);
}

}  // namespace twofold::bench
