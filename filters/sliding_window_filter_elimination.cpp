// The two elimination orders of FilterFactor.
#include <Eigen/Cholesky>
#include <algorithm>
#include <utility>

#include "filters/dense_algebra.hpp"
#include "filters/sliding_window_filter_factor.hpp"

namespace twofold {
namespace {

/// In-place lower Cholesky factor; false when not positive definite.
bool cholesky(MatrixX& S) {
  if (S.rows() == 0) return true;
  Eigen::LLT<Eigen::Ref<MatrixX>> llt(S);
  return llt.info() == Eigen::Success;
}

/// Solves L L^T x = b in place.
void solve_with(const MatrixX& L, VectorX& x) {
  solve_lower(L, x);
  solve_lower_transposed(L, x);
}

/// L^-1, block column by block column: above the diagonal nothing is solved for.
MatrixX inverse_factor(const MatrixX& L) {
  constexpr Eigen::Index kColumns = 48;
  const Eigen::Index n = L.rows();
  MatrixX Y = MatrixX::Identity(n, n);
  for (Eigen::Index at = 0; at < n; at += kColumns) {
    solve_lower(L.bottomRightCorner(n - at, n - at), Y.block(at, at, n - at, std::min(kColumns, n - at)));
  }
  return Y;
}

/// (L L^T)^-1
MatrixX inverse_from(const MatrixX& L) {
  MatrixX result = MatrixX::Zero(L.rows(), L.cols());
  if (L.rows() == 0) return result;
  result.selfadjointView<Eigen::Lower>().rankUpdate(inverse_factor(L).transpose());
  return result.selfadjointView<Eigen::Lower>();
}

}  // namespace

void FilterFactor::group_by_landmark(const FilterEquations& eq) {
  const int free = n_ - n_prior_;
  first_.assign(static_cast<std::size_t>(free) + 1, 0);
  for (const auto& c : eq.couplings) {
    if (c.landmark >= n_prior_) ++first_[static_cast<std::size_t>(c.landmark - n_prior_) + 1];
  }
  for (std::size_t l = 1; l < first_.size(); ++l) first_[l] += first_[l - 1];
  free_couplings_.resize(static_cast<std::size_t>(first_.back()));
  std::vector<int> next(first_.begin(), first_.end() - 1);
  for (const auto& c : eq.couplings) {
    if (c.landmark < n_prior_) continue;
    auto& slot =
        free_couplings_[static_cast<std::size_t>(next[static_cast<std::size_t>(c.landmark - n_prior_)]++)];
    slot.pose = c.pose;
    slot.W = c.W;
  }
}

// Order of the reduced system: [prior landmarks | poses].
bool FilterFactor::factorise_map_onto_path(const FilterEquations& eq, double damping) {
  const int p0 = 3 * n_prior_;
  S_.setZero(p0 + 6 * m_, p0 + 6 * m_);
  if (m_ > 0) S_.topLeftCorner(p0 + 6, p0 + 6) = eq.prior;  // pose 0 follows the prior landmarks
  for (int l = 0; l < n_prior_; ++l) S_.block<3, 3>(3 * l, 3 * l) += eq.V[static_cast<std::size_t>(l)];
  for (int j = 0; j < m_; ++j) {
    S_.block<6, 6>(p0 + 6 * j, p0 + 6 * j) += eq.U[static_cast<std::size_t>(j)];
    if (j + 1 < m_)
      S_.block<6, 6>(p0 + 6 * (j + 1), p0 + 6 * j) += eq.E[static_cast<std::size_t>(j)].transpose();
  }
  for (const auto& c : eq.couplings) {
    if (c.landmark < n_prior_) S_.block<6, 3>(p0 + 6 * c.pose, 3 * c.landmark) += c.W;
  }
  group_by_landmark(eq);
  V_inv_.resize(static_cast<std::size_t>(n_ - n_prior_));
  for (std::size_t l = 0; l < V_inv_.size(); ++l) {  // Schur complement of each free landmark
    Matrix3 V = eq.V[static_cast<std::size_t>(n_prior_) + l];
    V.diagonal().array() += damping;
    const Eigen::LLT<Matrix3> llt(V);
    if (llt.info() != Eigen::Success) return false;
    V_inv_[l] = llt.solve(Matrix3::Identity());
    for (int a = first_[l]; a < first_[l + 1]; ++a) {
      auto& ca = free_couplings_[static_cast<std::size_t>(a)];
      ca.WV = ca.W * V_inv_[l];
      for (int b = first_[l]; b <= a; ++b) {  // couplings are ordered by pose: lower triangle
        const auto& cb = free_couplings_[static_cast<std::size_t>(b)];
        S_.block<6, 6>(p0 + 6 * ca.pose, p0 + 6 * cb.pose).noalias() -= ca.WV * cb.W.transpose();
      }
    }
  }
  S_.diagonal().array() += damping;
  return cholesky(S_);
}

void FilterFactor::solve_map_onto_path(const std::vector<Vector6>& gp, const std::vector<Vector3>& gm,
                                       FilterStep& step) const {
  const int p0 = 3 * n_prior_;
  VectorX x(p0 + 6 * m_);
  for (int l = 0; l < n_prior_; ++l) x.segment<3>(3 * l) = gm[static_cast<std::size_t>(l)];
  for (int j = 0; j < m_; ++j) x.segment<6>(p0 + 6 * j) = gp[static_cast<std::size_t>(j)];
  for (std::size_t l = 0; l < V_inv_.size(); ++l) {
    for (int a = first_[l]; a < first_[l + 1]; ++a) {
      const auto& c = free_couplings_[static_cast<std::size_t>(a)];
      x.segment<6>(p0 + 6 * c.pose) -= c.WV * gm[static_cast<std::size_t>(n_prior_) + l];
    }
  }
  solve_with(S_, x);
  step.poses.resize(static_cast<std::size_t>(m_));
  step.landmarks.resize(static_cast<std::size_t>(n_));
  for (int j = 0; j < m_; ++j) step.poses[static_cast<std::size_t>(j)] = x.segment<6>(p0 + 6 * j);
  for (int l = 0; l < n_prior_; ++l) step.landmarks[static_cast<std::size_t>(l)] = x.segment<3>(3 * l);
  for (std::size_t l = 0; l < V_inv_.size(); ++l) {
    Vector3 y = V_inv_[l] * gm[static_cast<std::size_t>(n_prior_) + l];
    for (int a = first_[l]; a < first_[l + 1]; ++a) {
      const auto& c = free_couplings_[static_cast<std::size_t>(a)];
      y -= c.WV.transpose() * step.poses[static_cast<std::size_t>(c.pose)];
    }
    step.landmarks[static_cast<std::size_t>(n_prior_) + l] = y;
  }
}

// Of the inverse L^-T L^-1 only the pose block and the diagonal blocks of the prior landmarks are needed.
FilterCovariances FilterFactor::covariances_map_onto_path() const {
  const int p0 = 3 * n_prior_;
  const MatrixX Y = inverse_factor(S_);
  const auto Y_poses = Y.bottomRightCorner(6 * m_, 6 * m_);
  MatrixX poses = MatrixX::Zero(6 * m_, 6 * m_);
  add_product(poses, 1.0, Y_poses.transpose(), Y_poses);
  FilterCovariances result;
  for (int j = 0; j < m_; ++j) result.poses.push_back(poses.block<6, 6>(6 * j, 6 * j));
  for (int l = 0; l < n_prior_; ++l) {
    const auto Y_l = Y.block(3 * l, 3 * l, p0 + 6 * m_ - 3 * l, 3);
    result.landmarks.push_back(Y_l.transpose() * Y_l);
  }
  for (std::size_t l = 0; l < V_inv_.size(); ++l) {
    Matrix3 C = V_inv_[l];
    for (int a = first_[l]; a < first_[l + 1]; ++a) {
      const auto& ca = free_couplings_[static_cast<std::size_t>(a)];
      for (int b = first_[l]; b < first_[l + 1]; ++b) {
        const auto& cb = free_couplings_[static_cast<std::size_t>(b)];
        C += ca.WV.transpose() * poses.block<6, 6>(6 * ca.pose, 6 * cb.pose) * cb.WV;
      }
    }
    result.landmarks.push_back(C);
  }
  return result;
}

// Poses are eliminated in the order of time; each passes its information to the next one and to the map.
bool FilterFactor::factorise_path_onto_map(const FilterEquations& eq, double damping) {
  const int p0 = 3 * n_prior_;
  S_.setZero(3 * n_, 3 * n_);
  if (m_ > 0) S_.topLeftCorner(p0, p0) = eq.prior.topLeftCorner(p0, p0);
  for (int l = 0; l < n_; ++l) S_.block<3, 3>(3 * l, 3 * l) += eq.V[static_cast<std::size_t>(l)];
  S_.diagonal().array() += damping;
  Y_W_.setZero(6 * m_, 3 * n_);
  for (const auto& c : eq.couplings) Y_W_.block<6, 3>(6 * c.pose, 3 * c.landmark) += c.W;
  if (m_ > 0) Y_W_.topLeftCorner(6, p0) += eq.prior.bottomLeftCorner(6, p0);
  L_.resize(static_cast<std::size_t>(m_));
  Y_E_.assign(static_cast<std::size_t>(std::max(0, m_ - 1)), Matrix6::Zero());
  Matrix6 passed_on = m_ > 0 ? Matrix6(eq.prior.bottomRightCorner(6, 6)) : Matrix6::Zero();
  for (int j = 0; j < m_; ++j) {
    const auto i = static_cast<std::size_t>(j);
    Matrix6 pivot = eq.U[i] + passed_on;
    pivot.diagonal().array() += damping;
    const Eigen::LLT<Matrix6> llt(pivot);
    if (llt.info() != Eigen::Success) return false;
    L_[i] = llt.matrixL();
    auto row = Y_W_.middleRows<6>(6 * j);
    solve_lower(L_[i], row);
    if (j + 1 == m_) break;
    passed_on.setZero();
    if (!has_motion_) continue;
    Y_E_[i] = eq.E[i];
    solve_lower(L_[i], Y_E_[i]);
    passed_on.noalias() = -Y_E_[i].transpose() * Y_E_[i];
    add_product(Y_W_.middleRows<6>(6 * (j + 1)), -1.0, Y_E_[i].transpose(), row);
  }
  if (n_ > 0) S_.selfadjointView<Eigen::Lower>().rankUpdate(Y_W_.transpose(), -1.0);
  return cholesky(S_);
}

void FilterFactor::solve_path_onto_map(const std::vector<Vector6>& gp, const std::vector<Vector3>& gm,
                                       FilterStep& step) const {
  VectorX y(6 * m_);
  for (int j = 0; j < m_; ++j) {
    const auto i = static_cast<std::size_t>(j);
    Vector6 g = gp[i];
    if (j > 0) g -= Y_E_[i - 1].transpose() * y.segment<6>(6 * (j - 1));
    solve_lower(L_[i], g);
    y.segment<6>(6 * j) = g;
  }
  VectorX x(3 * n_);
  for (int l = 0; l < n_; ++l) x.segment<3>(3 * l) = gm[static_cast<std::size_t>(l)];
  add_product(x, -1.0, Y_W_.transpose(), y);
  solve_with(S_, x);
  add_product(y, -1.0, Y_W_, x);
  step.poses.resize(static_cast<std::size_t>(m_));
  step.landmarks.resize(static_cast<std::size_t>(n_));
  for (int l = 0; l < n_; ++l) step.landmarks[static_cast<std::size_t>(l)] = x.segment<3>(3 * l);
  for (int j = m_ - 1; j >= 0; --j) {
    const auto i = static_cast<std::size_t>(j);
    Vector6 r = y.segment<6>(6 * j);
    if (j + 1 < m_) r -= Y_E_[i] * step.poses[i + 1];
    solve_lower_transposed(L_[i], r);
    step.poses[i] = r;
  }
}

FilterCovariances FilterFactor::covariances_path_onto_map() const {
  const MatrixX map = inverse_from(S_);
  FilterCovariances result;
  for (int l = 0; l < n_; ++l) result.landmarks.push_back(map.block<3, 3>(3 * l, 3 * l));
  result.poses.resize(static_cast<std::size_t>(m_));
  // x_j = L^-T (y - Y_E x_j+1 - Y_W x_map): carry cov(x_j, map) backwards along the chain.
  MatrixX cross_next;  // cov(x_j+1, map)
  for (int j = m_ - 1; j >= 0; --j) {
    const auto i = static_cast<std::size_t>(j);
    const auto Y_W = Y_W_.middleRows<6>(6 * j);
    const MatrixX Y_W_t = Y_W.transpose();
    MatrixX cross = MatrixX::Zero(6, 3 * n_);
    add_product(cross, -1.0, Y_W, map);
    Matrix6 inner = Matrix6::Identity();
    add_product(inner, -1.0, cross, Y_W_t);
    if (j + 1 < m_) {
      Matrix6 next = Matrix6::Zero();
      add_product(next, 1.0, cross_next, Y_W_t);
      const Matrix6 mixed = Y_E_[i] * next;
      inner += Y_E_[i] * result.poses[i + 1] * Y_E_[i].transpose() + mixed + mixed.transpose();
      add_product(cross, -1.0, Y_E_[i], cross_next);
    }
    solve_lower_transposed(L_[i], cross);
    solve_lower_transposed(L_[i], inner);
    result.poses[i] = inner.transpose();
    solve_lower_transposed(L_[i], result.poses[i]);
    cross_next = std::move(cross);
  }
  return result;
}

}  // namespace twofold
