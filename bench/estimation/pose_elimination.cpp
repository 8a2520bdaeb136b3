#include "bench/estimation/pose_elimination.hpp"

#include <cmath>
#include <limits>
#include <utility>

#include "estimation/minimise.hpp"
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
      if (!((problem.poses[o.pose].T_k_w * p_w).z() > 2 * kSolverMinDepth)) continue;
      by_pose[o.pose].push_back({static_cast<int>(k), o.pixel, o.information});
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
  const HuberKernel kernel{options.huber_sigmas};
  std::vector<Vector3> x_w;
  x_w.reserve(values.psi.size());
  for (std::size_t k = 0; k < values.psi.size(); ++k) {
    x_w.push_back(T_w_frame_[k] * from_inverse_depth(values.psi[k]));
  }
  double sum = 0;
  for (std::size_t i = 0; i < values.poses.size(); ++i) {
    const Matrix3 R = values.poses[i].rotation();
    for (int n = begin_[i]; n < begin_[i + 1]; ++n) {
      const Observation& o = observations_[n];
      const Vector3 x = R * x_w[o.point] + values.poses[i].translation();
      const double chi2 = model_->chi2(x, o.pixel, o.information);
      if (!std::isfinite(chi2)) return std::numeric_limits<double>::infinity();
      sum += kernel.rho(chi2);
    }
  }
  return sum;
}

void PoseElimination::linearise_points(const Values& values) {
  points_.resize(values.psi.size());
  for (std::size_t k = 0; k < values.psi.size(); ++k) {
    const Matrix3 R = T_w_frame_[k].rotation();
    const double inv_q = 1 / values.psi[k].z();
    const Vector3 Ry = R * from_inverse_depth(values.psi[k]);
    points_[k].x_w = Ry + T_w_frame_[k].translation();
    points_[k].dx_dpsi << R.col(0) * inv_q, R.col(1) * inv_q, -inv_q * Ry;  // (B.20)
  }
}

/// With A = J_x [I, -[x]x] by the pose and B = J_x dx/dpsi by the point, J_x and W in the terms of the model:
/// H = sum A^T W A, coupling A^T W B, V = sum B^T W B.
void PoseElimination::linearise_pose(int i, const HuberKernel& kernel, const Values& values) {
  const Matrix3 R = values.poses[i].rotation();
  const Vector3& t = values.poses[i].translation();
  Couplings Yt = couplings(i);
  Matrix3 H_vv = Matrix3::Zero(), H_wv = Matrix3::Zero(), H_ww = Matrix3::Zero();
  Vector3 g_v = Vector3::Zero(), g_w = Vector3::Zero();
  for (int n = begin_[i]; n < begin_[i + 1]; ++n) {
    const Observation& o = observations_[n];
    const WorldPoint& point = points_[o.point];
    const Vector3 x = R * point.x_w + t;
    const ObservationTerms terms = model_->linearise(x, o.pixel, o.information, kernel);
    const Matrix3 J = R * point.dx_dpsi;
    Matrix3 S;
    S << terms.s00, 0, terms.s02, 0, terms.s11, terms.s12, terms.s02, terms.s12, terms.s22;
    const Matrix3 X = hat(x);
    const Matrix3 XS = X.lazyProduct(S);
    const Matrix3 JtS = J.transpose().lazyProduct(S);
    H_vv += S;
    H_wv += XS;
    H_ww -= XS.lazyProduct(X);
    g_v += terms.force;
    g_w += x.cross(terms.force);
    Yt.block<3, 3>(3 * (n - begin_[i]), 0) = JtS;
    Yt.block<3, 3>(3 * (n - begin_[i]), 3) = -JtS.lazyProduct(X);  // X^T = -X
    V_[o.point] += JtS.lazyProduct(J);
    gradient_.segment<3>(3 * o.point) += J.transpose().lazyProduct(terms.force);
  }
  PoseBlock& block = blocks_[i];
  block.H << H_vv, H_wv.transpose(), H_wv, H_ww;
  block.gradient << g_v, g_w;
}

/// Subtracts Y_k^T Y_l and Y_k^T c, Y = L^-1 A^T W B, from the system of the points (lower triangle).
void PoseElimination::eliminate(int i) {
  PoseBlock& block = blocks_[i];
  block.c = block.L.triangularView<Eigen::Lower>().solve(block.gradient);
  Couplings Yt = couplings(i);
  for (int r = 0; r < 6; ++r) {
    for (int q = 0; q < r; ++q) Yt.col(r) -= block.L(r, q) * Yt.col(q);
    Yt.col(r) *= 1 / block.L(r, r);
  }
  const int count = begin_[i + 1] - begin_[i];
  const Observation* seen = observations_.data() + begin_[i];
  for (int m = 0; m < count; ++m) {
    const int below = 3 * (count - m), l = 3 * seen[m].point;
    const Eigen::Matrix<double, 3, 6> Yt_m = Yt.middleRows<3>(3 * m);
    reduced_gradient_.segment<3>(l) -= Yt_m.lazyProduct(block.c);
    products_.resize(3 * count, 3);
    products_.topRows(below) = Yt.bottomRows(below).lazyProduct(Yt_m.transpose());
    for (int n = m; n < count; ++n) {
      const int k = 3 * seen[n].point;  // not below l: observations stand in the order of points
      const auto product = products_.middleRows<3>(3 * (n - m));
      reduced_.block<3, 3>(k, l) -= product;
      if (n > m && k == l) reduced_.block<3, 3>(k, l) -= product.transpose();
    }
  }
}

std::optional<double> PoseElimination::advance(const WindowSolverOptions& options, const Values& values,
                                               double lambda, Values& next) {
  const int poses = static_cast<int>(values.poses.size()), points = static_cast<int>(values.psi.size());
  blocks_.resize(poses);
  couplings_.resize(18 * observations_.size());
  V_.assign(points, Matrix3::Zero());
  gradient_.setZero(3 * points);
  reduced_.setZero(3 * points, 3 * points);
  linearise_points(values);
  for (int i = 0; i < poses; ++i) linearise_pose(i, HuberKernel{options.huber_sigmas}, values);
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
    const Couplings Yt = couplings(i);
    Vector6 v = block.c;
    for (int n = begin_[i]; n < begin_[i + 1]; ++n) {
      v += Yt.middleRows<3>(3 * (n - begin_[i])).transpose() * delta.segment<3>(3 * observations_[n].point);
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
    if (y.z() > kSolverMinDepth) point.psi = to_inverse_depth(y);
  }
}

SolverSummary PoseElimination::solve(WindowProblem& problem, const WindowSolverOptions& options) {
  Values values = start(problem), next;
  const auto try_step = [&](double lambda, double present) {
    return judge_step(advance(options, values, lambda, next), present, [&] { return cost(options, next); });
  };
  const SolverSummary summary =
      minimise(cost(options, values), options, try_step, [&] { std::swap(values, next); });
  if (summary.accepted_steps > 0) write_back(values, problem);
  return summary;
}

}  // namespace twofold
