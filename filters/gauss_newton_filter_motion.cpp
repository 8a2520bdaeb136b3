// Pose of a new frame given the filter's map  (algorithm 6).
#include <Eigen/Dense>
#include <cmath>

#include "filters/gauss_newton_filter.hpp"

namespace twofold {

/// Innovation covariance S = J_Phi Sigma J_Phi^T + Sigma_z (only the measurement part without Sigma), pose
/// Jacobian of the prediction and residual d = z - z_hat. False when a point is behind the camera.
bool GaussNewtonFilter::innovation(const std::vector<Seen>& seen, const MatrixX* Sigma, MatrixX& S,
                                   MatrixX& J_T, VectorX& d) const {
  const int rows = this->rows();
  const auto total = rows * static_cast<Eigen::Index>(seen.size());
  MatrixX J_map;
  if (Sigma != nullptr) J_map = MatrixX::Zero(total, Sigma->rows());
  J_T.resize(total, 6);
  d.resize(total);
  for (std::size_t i = 0; i < seen.size(); ++i) {
    const Point& point = points_[static_cast<std::size_t>(seen[i].point)];
    const auto p = project_inverse_depth(rig_, T_c_anchor(point.anchor), point.psi);
    if (!p) return false;
    const auto row = rows * static_cast<Eigen::Index>(i);
    J_T.middleRows(row, rows) = p->J_camera.topRows(rows);
    d.segment(row, rows) = (seen[i].z - p->z_hat).head(rows);
    if (Sigma == nullptr) continue;
    J_map.block(row, point_at(seen[i].point), rows, 3) = p->J_psi.topRows(rows);
    if (point.anchor > 0) J_map.block(row, anchor_at(point.anchor), rows, 6) = p->J_anchor.topRows(rows);
  }
  if (Sigma != nullptr) {
    S.noalias() = J_map * *Sigma * J_map.transpose();
    S.diagonal().array() += options_.sigma_px * options_.sigma_px;
  }
  return true;
}

/// A point whose depth is unknown says nothing about a motion yet: with a start value for its depth taken as
/// exact it would mislead, with its infinite covariance it cannot be inverted.
std::vector<GaussNewtonFilter::Seen> GaussNewtonFilter::with_depth(const std::vector<Seen>& all) const {
  std::vector<Seen> seen;
  for (const Seen& s : all) {
    const int at = point_at(s.point);
    InverseDepthFilter own;
    own.information = Lambda_.block<3, 3>(at, at);
    if (std::isfinite(own.inverse_depth_sigma())) seen.push_back(s);
  }
  return seen;
}

/// Expects the state without current pose; moves T_c_w_ from the previous pose.
void GaussNewtonFilter::estimate_motion(const std::vector<Seen>& all) {
  const std::vector<Seen> seen = with_depth(all);
  if (seen.size() < 4) return;
  MatrixX Sigma;
  const bool use_map = options_.motion != MotionEstimate::kMotionOnly;
  if (use_map) {
    MatrixX regular = Lambda_;
    regular.diagonal().array() += 1e-9;  // fresh points without depth
    Sigma = regular.llt().solve(MatrixX::Identity(Lambda_.rows(), Lambda_.cols()));
  }
  MatrixX S, J;
  VectorX d;
  const MatrixX* map = use_map ? &Sigma : nullptr;
  if (!innovation(seen, map, S, J, d)) return;
  Eigen::LLT<MatrixX> llt;
  if (use_map) llt.compute(S);
  const double weight = 1 / (options_.sigma_px * options_.sigma_px);
  const auto whiten = [&](const auto& m) -> MatrixX {
    return use_map ? MatrixX(llt.solve(m)) : MatrixX(weight * m);
  };
  const bool once = options_.motion == MotionEstimate::kMapPriorOnce;
  double chi2 = d.dot(whiten(d).col(0));
  double damping = 1e-6;
  for (int iteration = 0; iteration < options_.motion_iterations; ++iteration) {
    const MatrixX WJ = whiten(J);
    Matrix6 H = WJ.transpose() * J;
    const Vector6 g = WJ.transpose() * d;
    H.diagonal() *= 1 + damping;
    const SE3 T_old = T_c_w_;
    const Eigen::LLT<MatrixX> llt_old = llt;
    const Vector6 delta = H.ldlt().solve(g);
    T_c_w_ = SE3::exp(delta) * T_c_w_;
    MatrixX J_next, S_next;
    VectorX d_next;
    double next = std::numeric_limits<double>::infinity();
    if (delta.allFinite() && innovation(seen, once ? nullptr : map, S_next, J_next, d_next)) {
      if (use_map && !once) llt.compute(S_next);  // step 7
      next = d_next.dot(whiten(d_next).col(0));
    }
    if (!(next < chi2)) {
      T_c_w_ = T_old;
      llt = llt_old;
      if (delta.norm() < 1e-9) break;
      damping = std::max(10 * damping, 1e-4);
      continue;
    }
    const bool done = chi2 - next < 1e-6;
    chi2 = next;
    J = std::move(J_next);
    d = std::move(d_next);
    damping *= 0.1;
    if (done) break;
  }
}

}  // namespace twofold
