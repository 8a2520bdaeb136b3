#include "filters/sliding_window_filter_prior.hpp"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <limits>

#include "base/check.hpp"
#include "geometry/cbh.hpp"

namespace twofold {
namespace {

/// Whether a Cholesky factor can be solved with: its pivots' ratio bounds the condition from below, cheaply.
template <class Factor>
bool is_regular(const Factor& llt) {
  constexpr double kLeastRatio = 1e-14;
  if (llt.info() != Eigen::Success || llt.matrixLLT().rows() == 0) return llt.info() == Eigen::Success;
  double least = std::numeric_limits<double>::infinity();
  double most = 0;
  for (Eigen::Index i = 0; i < llt.matrixLLT().rows(); ++i) {
    const double pivot = llt.matrixLLT()(i, i) * llt.matrixLLT()(i, i);
    least = std::min(least, pivot);
    most = std::max(most, pivot);
  }
  return least > kLeastRatio * most;
}

/// Y = D^-1/2 L^-1 P B for A = P^T L D L^T P, without the directions that A says nothing about. Y^T Y is then
/// B^T A^+ B where the columns of B lie in the range of A, as they do in any sum of squares.
void whiten_singular(const MatrixX& A, MatrixX& Y, VectorX& y) {
  const Eigen::LDLT<MatrixX> ldlt(A);
  const VectorX D = ldlt.vectorD();
  const double floor = 1e-12 * std::max(1.0, D.cwiseAbs().maxCoeff());
  const VectorX scale = D.unaryExpr([floor](double d) { return d > floor ? 1.0 / std::sqrt(d) : 0.0; });
  const MatrixX L = ldlt.matrixL();
  Y = ldlt.transpositionsP() * Y;
  y = ldlt.transpositionsP() * y;
  // Row by row: a direction without information must not reach the rows below it.
  for (Eigen::Index i = 0; i < A.rows(); ++i) {
    if (scale[i] == 0) {
      Y.row(i).setZero();
      y[i] = 0;
      continue;
    }
    for (Eigen::Index k = 0; k < i; ++k) {
      Y.row(i) -= L(i, k) * Y.row(k);
      y[i] -= L(i, k) * y[k];
    }
  }
  for (Eigen::Index i = 0; i < A.rows(); ++i) {
    Y.row(i) *= scale[i];
    y[i] *= scale[i];
  }
}

}  // namespace

VectorX FilterPrior::difference(const std::vector<Vector3>& landmarks, const SE3& T_c_w,
                                const Vector6& shift) const {
  const int n = landmark_count();
  VectorX d(3 * n + 6);
  for (int l = 0; l < n; ++l) {
    const auto i = static_cast<std::size_t>(l);
    d.segment<3>(3 * l) = landmarks[i] - landmarks_lin[i];
  }
  d.tail<6>() = (T_c_w * T_lin.inverse()).log();
  if (!shift.isZero(0)) d.noalias() += rigid_motion() * shift;
  return d;
}

MatrixX FilterPrior::rigid_motion() const {
  const int n = landmark_count();
  const Matrix3 R_l_c = T_lin.rotation().transpose();
  MatrixX N(3 * n + 6, 6);
  for (int l = 0; l < n; ++l) {
    const Vector3 x_c = T_lin * landmarks_lin[static_cast<std::size_t>(l)];
    N.middleRows<3>(3 * l) << R_l_c, -R_l_c * hat(x_c);
  }
  N.bottomRows<6>() = -Matrix6::Identity();
  return N;
}

void FilterPrior::fit_frame() {
  const int n = landmark_count();
  const MatrixX N = rigid_motion();
  follow.resize(6, 3 * n + 6);  // (N^T W N)^-1 N^T W
  for (int l = 0; l < n; ++l) {
    follow.middleCols<3>(3 * l) = N.middleRows<3>(3 * l).transpose() * information.block<3, 3>(3 * l, 3 * l);
  }
  follow.rightCols<6>() = N.bottomRows<6>().transpose() * information.bottomRightCorner<6, 6>();
  const Eigen::LLT<Matrix6> llt(Matrix6(follow * N));
  if (is_regular(llt)) {
    llt.solveInPlace(follow);
  } else {
    follow.resize(6, 0);  // too few parameters to carry a frame
  }
}

Vector6 FilterPrior::frame_twist(const FilterStep& step) const {
  Vector6 xi = Vector6::Zero();
  if (follow.cols() == 0) return xi;
  for (int l = 0; l < landmark_count(); ++l) {
    xi += follow.middleCols<3>(3 * l) * step.landmarks[static_cast<std::size_t>(l)];
  }
  return xi + follow.rightCols<6>() * step.poses.front();
}

SE3 FilterPrior::move_frame(const Vector6& shift) {
  vector.noalias() -= information * (rigid_motion() * shift);
  return T_lin.inverse() * SE3::exp(shift) * T_lin;
}

void FilterPrior::relinearise(const std::vector<Vector3>& landmarks, const SE3& T_c_w) {
  const VectorX d = difference(landmarks, T_c_w);
  const Matrix6 J = cbh_jacobian<SE3>(d.tail<6>(), CbhOrder::kExact);
  vector.noalias() -= information * d;
  // Change of chart: derivative of d by the left perturbation at the new point is diag(I, J).
  vector.tail<6>() = (J.transpose() * vector.tail<6>()).eval();
  const MatrixX right = information.rightCols<6>() * J;
  information.rightCols<6>() = right;
  const MatrixX bottom = J.transpose() * information.bottomRows<6>();
  information.bottomRows<6>() = bottom;
  for (std::size_t l = 0; l < landmarks_lin.size(); ++l) landmarks_lin[l] = landmarks[l];
  T_lin = T_c_w;
}

void schur_marginalise(MatrixX& Lambda, VectorX& g, int eliminated, FillIn fill_in,
                       const std::vector<int>& block_sizes) {
  const int kept = static_cast<int>(Lambda.rows()) - eliminated;
  const MatrixX A = Lambda.topLeftCorner(eliminated, eliminated);
  const MatrixX B = Lambda.topRightCorner(eliminated, kept);
  MatrixX C = Lambda.bottomRightCorner(kept, kept);
  VectorX g_kept = g.tail(kept);
  // Y^T Y is the fill-in, with Y = L^-1 B: symmetric and positive semi-definite by construction.
  MatrixX Y = B;
  VectorX y = g.head(eliminated);
  const Eigen::LLT<MatrixX> llt(A);
  if (is_regular(llt)) {
    llt.matrixL().solveInPlace(Y);
    llt.matrixL().solveInPlace(y);
  } else {
    whiten_singular(A, Y, y);
  }
  g_kept.noalias() -= Y.transpose() * y;
  if (fill_in == FillIn::kFull) {
    C.selfadjointView<Eigen::Lower>().rankUpdate(Y.transpose(), -1.0);
    C = MatrixX(C.selfadjointView<Eigen::Lower>());
  } else {
    int at = 0;
    for (const int size : block_sizes) {
      const auto block = Y.middleCols(at, size);
      C.block(at, at, size, size).noalias() -= block.transpose() * block;
      at += size;
    }
    TWOFOLD_CHECK(at == kept, "block sizes cover the remaining unknowns");
  }
  Lambda = std::move(C);
  g = std::move(g_kept);
}

}  // namespace twofold
