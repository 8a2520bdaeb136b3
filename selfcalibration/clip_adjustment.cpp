#include "selfcalibration/clip_adjustment.hpp"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <optional>
#include <span>

#include "base/median.hpp"
#include "estimation/levenberg_marquardt.hpp"

namespace twofold {
namespace {

constexpr double kKernel = 20;  // of a corner's mean squared error [variances]; two are expected
constexpr double kRhoSigma =
    3;  // of inverse depth about one: where nothing is seen of it, and the unit of length
constexpr double kNearest = 0.05;  // depth in a view over that in the first one
constexpr double kBehind = 1e4;    // squared error of a corner behind the camera [variances]

struct Projection {
  Vector2 uv{0, 0};
  Matrix23 d_point = Matrix23::Zero();  ///< by the point before projection
  Eigen::Matrix<double, 2, kLensParameters> d_lens;
};

/// False behind the camera.
bool project(const SharedLens& lens, const Vector3& p, const Vector2& seen, const Vector2& velocity,
             Projection& out, bool jacobians) {
  if (p.z() < kNearest) return false;
  const double inv_z = 1 / p.z();
  const Vector2 q = p.head<2>() * inv_z;
  const double r2 = q.squaredNorm(), f = lens.f();
  const double d = 1 + r2 * (lens.k1 + r2 * lens.k2);
  const double s = (seen.y() + 0.5) / lens.height - 0.5;
  out.uv = f * d * q + lens.centre + s * lens.readout * velocity;
  if (!jacobians) return true;
  const Eigen::Matrix2d d_q =
      f * (d * Eigen::Matrix2d::Identity() + (2 * lens.k1 + 4 * lens.k2 * r2) * q * q.transpose());
  Matrix23 q_p;
  q_p << inv_z, 0, -q.x() * inv_z, 0, inv_z, -q.y() * inv_z;
  out.d_point = d_q * q_p;
  out.d_lens << f * d * q, f * r2 * q, f * r2 * r2 * q, Eigen::Matrix2d::Identity(), s * velocity;
  return true;
}

Vector3 ray_at(const SE3& T, const Vector3& psi) {
  return T.so3() * Vector3(psi.x(), psi.y(), 1) + psi.z() * T.translation();
}

/// A corner in the views that see it, in step with the clip's.
struct ProjectedCorner {
  std::vector<Projection> projections;
  std::vector<Vector2> errors;  ///< [standard deviations]
  double mean_square = 0;       ///< of these
};

/// None when it is behind the camera in one of them.
std::optional<ProjectedCorner> project_corner(const Clip& clip, const ClipMotion& motion,
                                              const SharedLens& lens, std::size_t corner, double sigma_px) {
  const std::size_t n = clip.views.size();
  ProjectedCorner seen{std::vector<Projection>(n), std::vector<Vector2>(n, Vector2::Zero())};
  double sum = 0, views = 0;
  for (std::size_t k = 0; k < n; ++k) {
    const ClipView& view = clip.views[k];
    if (!view.sees(corner)) continue;
    ++views;
    if (!project(lens, ray_at(motion.T_view_first[k], motion.psi[corner]), view.uv[corner],
                 view.velocity[corner], seen.projections[k], true)) {
      return std::nullopt;
    }
    seen.errors[k] = (view.uv[corner] - seen.projections[k].uv) / sigma_px;
    sum += seen.errors[k].squaredNorm();
  }
  seen.mean_square = sum / views;
  return seen;
}

}  // namespace

double SharedLens::f() const {
  return std::exp(log_f);
}

SharedLens SharedLens::plus(const LensVector& step) const {
  SharedLens lens = *this;
  lens.log_f += step[0];
  lens.k1 += step[1];
  lens.k2 += step[2];
  lens.centre += step.segment<2>(3);
  lens.readout += step[5];
  return lens;
}

ClipAdjustment::ClipAdjustment(const Clip& clip, double sigma_px) : clip_(&clip), sigma_(sigma_px) {}

ClipAdjustment::CornerError ClipAdjustment::corner_error(const SharedLens& lens, const ClipMotion& of,
                                                         std::size_t corner, double sigma_px) const {
  CornerError error;
  Projection projection;
  for (std::size_t k = 0; k < clip_->views.size(); ++k) {
    const ClipView& view = clip_->views[k];
    if (!view.sees(corner)) continue;
    ++error.views;
    const bool in_front = project(lens, ray_at(of.T_view_first[k], of.psi[corner]), view.uv[corner],
                                  view.velocity[corner], projection, false);
    error.sum += in_front ? (view.uv[corner] - projection.uv).squaredNorm() / (sigma_px * sigma_px) : kBehind;
  }
  return error;
}

double ClipAdjustment::cost(const SharedLens& lens, const ClipMotion& of) const {
  double cost = 0;
  for (std::size_t i = 0; i < clip_->corners(); ++i) {
    const auto [sum, n] = corner_error(lens, of, i, sigma_);
    const double rho = (of.psi[i].z() - 1) / kRhoSigma;
    const double excess = sum / n / kKernel;
    cost += n * kKernel * (redescending_ ? excess / (1 + excess) : std::log1p(excess)) + rho * rho;
  }
  return cost;
}

double ClipAdjustment::estimated_sigma(const SharedLens& lens) const {
  const auto corners = static_cast<double>(clip_->corners());
  std::vector<double> sums;
  for (std::size_t i = 0; i < clip_->corners(); ++i) {
    const auto [sum, n] = corner_error(lens, motion, i, 1);
    const double dof = std::max(1.0, 2 * n - 3 - pose_size() / corners);
    sums.push_back(sum / (dof * std::pow(1 - 2 / (9 * dof), 3)));  // median of chi2, Wilson and Hilferty
  }
  return std::sqrt(median(std::span(sums)));
}

bool ClipAdjustment::add_point(const SharedLens& lens, std::size_t corner, PointBlock& block) {
  const std::size_t n = clip_->views.size();
  const Vector3& psi = motion.psi[corner];
  Matrix3 V = Matrix3::Zero();
  block.g.setZero();
  block.W = Eigen::Matrix<double, Eigen::Dynamic, 3>::Zero(pose_size() + kLensParameters, 3);
  const auto seen = project_corner(*clip_, motion, lens, corner, sigma_);
  if (!seen) {
    block.V_inverse.setZero();
    return false;
  }
  const auto& [projections, errors, mean_square] = *seen;
  const double cauchy = 1 / (1 + mean_square / kKernel);
  const double weight = redescending_ ? cauchy * cauchy : cauchy;
  const int lens_at = pose_size();
  for (std::size_t k = 0; k < n; ++k) {
    if (!clip_->views[k].sees(corner)) continue;
    const SE3& T = motion.T_view_first[k];
    const Matrix3 R = T.rotation();
    Matrix3 p_psi;
    p_psi << R.col(0), R.col(1), T.translation();
    const Matrix23 d_psi = projections[k].d_point * p_psi / sigma_;
    const Eigen::Matrix<double, 2, kLensParameters> d_lens = projections[k].d_lens / sigma_;
    V += weight * d_psi.transpose() * d_psi;
    block.g += weight * d_psi.transpose() * errors[k];
    block.W.bottomRows<kLensParameters>() += weight * d_lens.transpose() * d_psi;
    H_.bottomRightCorner<kLensParameters, kLensParameters>() += weight * d_lens.transpose() * d_lens;
    g_.tail<kLensParameters>() += weight * d_lens.transpose() * errors[k];
    if (k == 0) continue;
    const int at = 6 * (static_cast<int>(k) - 1);
    Matrix36 p_pose;
    p_pose << psi.z() * Matrix3::Identity(), -hat(ray_at(T, psi));
    const Eigen::Matrix<double, 2, 6> d_pose = projections[k].d_point * p_pose / sigma_;
    H_.block<6, 6>(at, at) += weight * d_pose.transpose() * d_pose;
    H_.block<6, kLensParameters>(at, lens_at) += weight * d_pose.transpose() * d_lens;
    g_.segment<6>(at) += weight * d_pose.transpose() * errors[k];
    block.W.middleRows<6>(at) = weight * d_pose.transpose() * d_psi;
  }
  V(2, 2) += 1 / (kRhoSigma * kRhoSigma);
  block.g[2] -= (psi.z() - 1) / (kRhoSigma * kRhoSigma);
  block.V_inverse = V;  // inverted once the damping is known
  return true;
}

LensEquations ClipAdjustment::linearise(const SharedLens& lens, double damping) {
  const int poses = pose_size(), size = poses + kLensParameters;
  H_.setZero(size, size);
  g_.setZero(size);
  blocks_.resize(clip_->corners());
  std::vector<bool> usable(blocks_.size());
  for (std::size_t i = 0; i < blocks_.size(); ++i) usable[i] = add_point(lens, i, blocks_[i]);
  H_.diagonal().head(poses) *= 1 + damping;
  H_.diagonal().head(poses).array() += 1e-6;
  for (std::size_t i = 0; i < blocks_.size(); ++i) {
    if (!usable[i]) continue;
    PointBlock& block = blocks_[i];
    block.V_inverse.diagonal() *= 1 + damping;
    block.V_inverse = block.V_inverse.inverse().eval();
    const Eigen::Matrix<double, Eigen::Dynamic, 3> WV = block.W * block.V_inverse;
    H_.triangularView<Eigen::Upper>() -= WV * block.W.transpose();
    g_ -= WV * block.g;
  }
  const Eigen::MatrixXd full = H_.selfadjointView<Eigen::Upper>();
  const Eigen::LDLT<Eigen::MatrixXd> A(full.topLeftCorner(poses, poses));
  const Eigen::MatrixXd B = full.topRightCorner(poses, kLensParameters);
  A_inverse_B_ = A.solve(B);
  A_inverse_g_ = A.solve(g_.head(poses));
  LensEquations equations;
  equations.H = full.bottomRightCorner<kLensParameters, kLensParameters>() - B.transpose() * A_inverse_B_;
  equations.g = g_.tail<kLensParameters>() - B.transpose() * A_inverse_g_;
  return equations;
}

ClipMotion ClipAdjustment::stepped(const LensVector& lens_step) const {
  Eigen::VectorXd step(pose_size() + kLensParameters);
  step << A_inverse_g_ - A_inverse_B_ * lens_step, lens_step;
  ClipMotion result = motion;
  for (std::size_t k = 1; k < result.T_view_first.size(); ++k) {
    const Vector6 delta = step.segment<6>(6 * (static_cast<Eigen::Index>(k) - 1));
    result.T_view_first[k] = SE3::exp(delta) * result.T_view_first[k];
  }
  for (std::size_t i = 0; i < blocks_.size(); ++i)
    result.psi[i] += blocks_[i].V_inverse * (blocks_[i].g - blocks_[i].W.transpose() * step);
  return result;
}

double ClipAdjustment::solve_motion(const SharedLens& lens, int max_iterations) {
  LevenbergMarquardtDamping damping(1e-3);
  double present = cost(lens, motion);
  for (int i = 0; i < max_iterations && !damping.exhausted(); ++i) {
    (void)linearise(lens, damping.lambda());
    ClipMotion candidate = stepped(LensVector::Zero());
    const double next = cost(lens, candidate);
    if (!(next < present)) {
      damping.reject();
      continue;
    }
    motion = std::move(candidate);
    damping.accept(1);
    const bool done = present - next < 1e-4 * next;
    present = next;
    if (done) break;
  }
  return present;
}

}  // namespace twofold
