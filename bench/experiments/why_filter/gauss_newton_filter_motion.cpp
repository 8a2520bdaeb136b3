// Pose of a new frame given the filter's map  (algorithm 6).
#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <utility>

#include "estimation/levenberg_marquardt.hpp"
#include "experiments/why_filter/gauss_newton_filter.hpp"

namespace twofold::bench {

/// What measurements say against their prediction by map and pose.
struct GaussNewtonFilter::Innovation {
  VectorX d;      ///< z - z_hat
  MatrixX J_T;    ///< of z_hat, by a left perturbation of T_c_w
  MatrixX J_map;  ///< of z_hat, by the rest of the state; empty where the map is taken as exact
};

/// Inverse of an innovation's covariance S = J_map Sigma J_map^T + Sigma_z  (algorithm 6), or of Sigma_z
/// alone.
class GaussNewtonFilter::InnovationWeight {
 public:
  explicit InnovationWeight(double sigma_px) : variance_(sigma_px * sigma_px) {}
  InnovationWeight(double sigma_px, const MatrixX& J_map, const MatrixX& Sigma) : InnovationWeight(sigma_px) {
    MatrixX S;
    S.noalias() = J_map * Sigma * J_map.transpose();
    S.diagonal().array() += variance_;
    S_.emplace(S);
  }
  [[nodiscard]] MatrixX operator*(const MatrixX& m) const {
    return S_ ? MatrixX(S_->solve(m)) : MatrixX(1 / variance_ * m);
  }
  [[nodiscard]] double chi2(const VectorX& d) const { return d.dot((*this * d).col(0)); }
  /// Of the pose, damped as Levenberg and Marquardt do.
  [[nodiscard]] Vector6 step(const Innovation& innovation, double damping) const {
    const MatrixX WJ = *this * innovation.J_T;
    Matrix6 H = WJ.transpose() * innovation.J_T;
    const Vector6 g = WJ.transpose() * innovation.d;
    H.diagonal() *= 1 + damping;
    return H.ldlt().solve(g);
  }

 private:
  double variance_;
  std::optional<Eigen::LLT<MatrixX>> S_;
};

/// None when a point is behind the camera.
std::optional<GaussNewtonFilter::Innovation> GaussNewtonFilter::innovation(const std::vector<Seen>& seen,
                                                                           bool with_map) const {
  const int rows = this->rows();
  const auto total = rows * static_cast<Eigen::Index>(seen.size());
  Innovation innovation{VectorX(total), MatrixX(total, 6), MatrixX()};
  MatrixX& J_map = innovation.J_map;
  if (with_map) J_map = MatrixX::Zero(total, Lambda_.rows());
  for (std::size_t i = 0; i < seen.size(); ++i) {
    const Point& point = points_[static_cast<std::size_t>(seen[i].point)];
    const auto p = project_inverse_depth(rig_, T_c_anchor(point.anchor), point.psi);
    if (!p) return std::nullopt;
    const auto row = rows * static_cast<Eigen::Index>(i);
    innovation.d.segment(row, rows) = (seen[i].pixel - p->z_hat).head(rows);
    innovation.J_T.middleRows(row, rows) = p->J_camera.topRows(rows);
    if (!with_map) continue;
    J_map.block(row, point_at(seen[i].point), rows, 3) = p->J_psi.topRows(rows);
    if (point.anchor > 0) J_map.block(row, anchor_at(point.anchor), rows, 6) = p->J_anchor.topRows(rows);
  }
  return innovation;
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

/// Covariance of anchors and points: expects the state without current pose.
MatrixX GaussNewtonFilter::map_covariance() const {
  MatrixX regular = Lambda_;
  regular.diagonal().array() += 1e-9;  // fresh points without depth
  return regular.llt().solve(MatrixX::Identity(Lambda_.rows(), Lambda_.cols()));
}

/// Expects the state without current pose; moves T_c_w_ from the previous pose.
void GaussNewtonFilter::estimate_motion(const std::vector<Seen>& all) {
  const std::vector<Seen> seen = with_depth(all);
  if (seen.size() < 4) return;
  const bool with_map = options_.motion != MotionEstimate::kMotionOnly;
  const bool weigh_anew = options_.motion == MotionEstimate::kMapPrior;  // step 7
  const MatrixX Sigma = with_map ? map_covariance() : MatrixX();
  auto current = innovation(seen, with_map);
  if (!current) return;
  const auto weight_of = [&](const Innovation& of) {
    return with_map ? InnovationWeight(options_.sigma_px, of.J_map, Sigma)
                    : InnovationWeight(options_.sigma_px);
  };
  InnovationWeight W = weight_of(*current);
  double chi2 = W.chi2(current->d);
  double damping = 1e-6;
  for (int iteration = 0; iteration < options_.motion_iterations; ++iteration) {
    const Vector6 delta = W.step(*current, damping);
    const SE3 T_before = std::exchange(T_c_w_, SE3::exp(delta) * T_c_w_);
    auto next = delta.allFinite() ? innovation(seen, weigh_anew) : std::nullopt;
    InnovationWeight W_next = next && weigh_anew ? weight_of(*next) : W;
    const double next_chi2 = next ? W_next.chi2(next->d) : std::numeric_limits<double>::infinity();
    if (!(next_chi2 < chi2)) {
      T_c_w_ = T_before;
      if (delta.norm() < 1e-9) break;
      damping = raised_damping(damping, 1e-4);
      continue;
    }
    const bool settled = chi2 - next_chi2 < 1e-6;
    chi2 = next_chi2;
    current = std::move(next);
    W = std::move(W_next);
    damping *= 0.1;
    if (settled) break;
  }
}

}  // namespace twofold::bench
