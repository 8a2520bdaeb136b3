#include "estimation/pose_elimination.hpp"

#include <cmath>
#include <limits>

#include "geometry/inverse_depth.hpp"

namespace twofold {

bool PoseElimination::is_cheaper(const WindowProblem& problem) {
  if (!problem.constraints.empty() || problem.points.empty()) return false;
  std::vector<double> seen(problem.poses.size(), 0);
  double points_first = std::pow(6.0 * static_cast<double>(problem.poses.size()), 3) / 6;
  for (const auto& point : problem.points) {
    points_first += 54.0 * point.observation_count * point.observation_count;
    for (int n = 0; n < point.observation_count; ++n) {
      ++seen[problem.observations[point.first_observation + n].pose];
    }
  }
  double poses_first = std::pow(3.0 * static_cast<double>(problem.points.size()), 3) / 6;
  for (const double count : seen) poses_first += 54.0 * count * count;
  // The reduced system of the poses is seldom full: only a clear case counts.
  constexpr double kClearly = 10;
  return kClearly * poses_first < points_first;
}

PoseElimination::Values PoseElimination::start(const WindowProblem& problem) {
  const int poses = static_cast<int>(problem.poses.size());
  model_.emplace(problem.rig);
  Values values;
  for (const auto& pose : problem.poses) values.poses.push_back(pose.T_k_w);
  std::vector<std::vector<Observation>> by_pose(poses);
  T_w_frame_.clear();
  seen_.assign(problem.points.size(), 0);
  for (std::size_t k = 0; k < problem.points.size(); ++k) {
    const auto& point = problem.points[k];
    T_w_frame_.push_back(problem.poses[point.anchor].T_k_w.inverse());
    values.psi.push_back(point.psi);
    if (!(point.psi.z() > 0)) continue;
    const Vector3 p_w = T_w_frame_[k] * from_inverse_depth(point.psi);
    for (int n = 0; n < point.observation_count; ++n) {
      const auto& o = problem.observations[point.first_observation + n];
      if (!((problem.poses[o.pose].T_k_w * p_w).z() > 2 * kMinDepth)) continue;
      by_pose[o.pose].push_back({static_cast<int>(k), o.z, o.information});
      seen_[k] = 1;
    }
  }
  begin_.assign(1, 0);
  observations_.clear();
  fixed_.clear();
  for (int i = 0; i < poses; ++i) {
    observations_.insert(observations_.end(), by_pose[i].begin(), by_pose[i].end());
    begin_.push_back(static_cast<int>(observations_.size()));
    fixed_.push_back(problem.poses[i].fixed || by_pose[i].empty());
  }
  return values;
}

double PoseElimination::cost(const WindowSolverOptions& options, const Values& values) const {
  const HuberKernel kernel{options.huber_px};
  double sum = 0;
  for (std::size_t i = 0; i < values.poses.size(); ++i) {
    for (int n = begin_[i]; n < begin_[i + 1]; ++n) {
      const Observation& o = observations_[n];
      const Vector3 p_w = T_w_frame_[o.point] * from_inverse_depth(values.psi[o.point]);
      const double chi2 = model_->chi2(values.poses[i] * p_w, o.z, o.information);
      if (!std::isfinite(chi2)) return std::numeric_limits<double>::infinity();
      sum += kernel.rho(chi2);
    }
  }
  return sum;
}

/// With A = J_x [I, -[x]x] by the pose and B = J_x dx/dpsi by the point, J_x and W in the terms of the model:
/// H = sum A^T W A, coupling A^T W B, V = sum B^T W B.
void PoseElimination::linearise_pose(int i, const HuberKernel& kernel, const Values& values) {
  PoseBlock& block = blocks_[i];
  block.H.setZero();
  block.gradient.setZero();
  for (int n = begin_[i]; n < begin_[i + 1]; ++n) {
    const Observation& o = observations_[n];
    const Vector3& psi = values.psi[o.point];
    const double inv_q = 1 / psi.z();
    const SE3 T = values.poses[i] * T_w_frame_[o.point];
    const Matrix3 R = T.rotation();
    const Vector3 Ry = R * from_inverse_depth(psi);
    const Vector3 x = Ry + T.translation();
    const ObservationTerms terms = model_->linearise(x, o.z, o.information, kernel);
    Matrix3 J;  // dx / dpsi (B.20)
    J << R.col(0) * inv_q, R.col(1) * inv_q, -inv_q * Ry;
    Matrix3 S, SJ;
    S << terms.s00, 0, terms.s02, 0, terms.s11, terms.s12, terms.s02, terms.s12, terms.s22;
    SJ.noalias() = S * J;
    const Matrix3 X = hat(x);
    const Matrix3 XS = X * S;
    block.H.topLeftCorner<3, 3>() += S;
    block.H.bottomLeftCorner<3, 3>() += XS;
    block.H.topRightCorner<3, 3>() += XS.transpose();
    block.H.bottomRightCorner<3, 3>() -= XS * X;
    block.gradient.head<3>() += terms.force;
    block.gradient.tail<3>() += x.cross(terms.force);
    couplings_[n] << SJ, X * SJ;
    V_[o.point].noalias() += J.transpose() * SJ;
    gradient_.segment<3>(3 * o.point).noalias() += J.transpose() * terms.force;
  }
}

/// Subtracts Y_k^T Y_l and Y_k^T c, Y = L^-1 A^T W B, from the system of the points.
void PoseElimination::eliminate(int i) {
  PoseBlock& block = blocks_[i];
  const auto L = block.L.triangularView<Eigen::Lower>();
  block.c = L.solve(block.gradient);
  for (int n = begin_[i]; n < begin_[i + 1]; ++n) {
    L.solveInPlace(couplings_[n]);
    const int k = 3 * observations_[n].point;
    reduced_gradient_.segment<3>(k).noalias() -= couplings_[n].transpose() * block.c;
    for (int m = begin_[i]; m <= n; ++m) {
      const int l = 3 * observations_[m].point;  // not above k: observations stand in the order of points
      const Matrix3 product = couplings_[n].transpose().lazyProduct(couplings_[m]);
      reduced_.block<3, 3>(k, l) -= product;
      if (m < n && k == l) reduced_.block<3, 3>(k, l) -= product.transpose();
    }
  }
}

std::optional<double> PoseElimination::step(const WindowSolverOptions& options, const Values& values,
                                            double lambda, Values& next) {
  const int poses = static_cast<int>(values.poses.size()), points = static_cast<int>(values.psi.size());
  blocks_.resize(poses);
  couplings_.resize(observations_.size());
  V_.assign(points, Matrix3::Zero());
  gradient_.setZero(3 * points);
  reduced_.setZero(3 * points, 3 * points);
  for (int i = 0; i < poses; ++i) linearise_pose(i, HuberKernel{options.huber_px}, values);
  reduced_gradient_ = gradient_;
  for (int i = 0; i < poses; ++i) {
    if (fixed_[i] != 0) continue;
    PoseBlock& block = blocks_[i];
    block.damping = block.H.diagonal().cwiseMax(1e-6 * block.H.trace());
    block.H.diagonal() += lambda * block.damping;
    const Eigen::LLT<Matrix6> llt(block.H);
    if (llt.info() != Eigen::Success) return std::nullopt;
    block.L = llt.matrixL();
    eliminate(i);
  }
  std::vector<Vector3> damping(points);
  for (int k = 0; k < points; ++k) {
    damping[k] = seen_[k] != 0 ? damping_diagonal(V_[k]) : Vector3::Ones().eval();
    V_[k].diagonal() += (seen_[k] != 0 ? lambda : 1.0) * damping[k];  // unseen points stay
    reduced_.block<3, 3>(3 * k, 3 * k) += V_[k];
  }
  const Eigen::LLT<Eigen::Ref<Eigen::MatrixXd>> llt(reduced_);
  if (llt.info() != Eigen::Success) return std::nullopt;
  const Eigen::VectorXd delta = -llt.solve(reduced_gradient_);

  double predicted = -gradient_.dot(delta);
  next = values;
  for (int k = 0; k < points; ++k) {
    const Vector3 d = delta.segment<3>(3 * k);
    if (seen_[k] != 0) predicted += lambda * d.dot(damping[k].cwiseProduct(d));
    next.psi[k] += d;
    next.psi[k].z() = std::max(next.psi[k].z(), kMinInverseDepth);
  }
  for (int i = 0; i < poses; ++i) {
    if (fixed_[i] != 0) continue;
    const PoseBlock& block = blocks_[i];
    Vector6 v = block.c;
    for (int n = begin_[i]; n < begin_[i + 1]; ++n) {
      v.noalias() += couplings_[n] * delta.segment<3>(3 * observations_[n].point);
    }
    const Vector6 d = -block.L.transpose().triangularView<Eigen::Upper>().solve(v);
    predicted += -block.gradient.dot(d) + lambda * d.dot(block.damping.cwiseProduct(d));
    next.poses[i] = SE3::exp(d) * values.poses[i];
  }
  return std::isfinite(predicted) ? std::optional(predicted) : std::nullopt;
}

void PoseElimination::write_back(const Values& values, WindowProblem& problem) const {
  for (std::size_t i = 0; i < values.poses.size(); ++i) problem.poses[i].T_k_w = values.poses[i];
  for (std::size_t k = 0; k < values.psi.size(); ++k) {
    if (seen_[k] == 0) continue;
    auto& point = problem.points[k];
    const Vector3 y = problem.poses[point.anchor].T_k_w * (T_w_frame_[k] * from_inverse_depth(values.psi[k]));
    if (y.z() > kMinDepth) point.psi = to_inverse_depth(y);
  }
}

}  // namespace twofold
