#include "geometry/essential_matrix.hpp"

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <algorithm>
#include <array>
#include <cmath>
#include <iterator>
#include <limits>
#include <numeric>
#include <utility>

#include "geometry/five_point_polynomials.hpp"
#include "geometry/nearest_rotation.hpp"
#include "geometry/real_roots.hpp"
#include "geometry/triangulation.hpp"

namespace twofold {

Matrix3 essential_matrix(const SE3& T_b_a) {
  return hat(T_b_a.translation().normalized()) * T_b_a.rotation();
}

namespace {

using Constraints = Eigen::Matrix<double, 10, 20>;

/// E = x N0 + y N1 + z N2 + N3 must have det E = 0 and 2 E E^T E - tr(E E^T) E = 0: ten cubics in (x, y, z).
Constraints essential_constraints(const std::array<Matrix3, 4>& N) {
  using namespace five_point;
  Linear E[3][3];
  for (int r = 0; r < 3; ++r) {
    for (int c = 0; c < 3; ++c) E[r][c] << N[0](r, c), N[1](r, c), N[2](r, c), N[3](r, c);
  }
  Quadratic EEt[3][3];
  for (int r = 0; r < 3; ++r) {
    for (int c = r; c < 3; ++c) {
      EEt[r][c] = product(E[r][0], E[c][0]) + product(E[r][1], E[c][1]) + product(E[r][2], E[c][2]);
      EEt[c][r] = EEt[r][c];
    }
  }
  const Quadratic half_trace = 0.5 * (EEt[0][0] + EEt[1][1] + EEt[2][2]);
  for (int i = 0; i < 3; ++i) EEt[i][i] -= half_trace;

  Constraints rows;
  for (int r = 0; r < 3; ++r) {
    for (int c = 0; c < 3; ++c) {
      rows.row(3 * r + c) =
          product(EEt[r][0], E[0][c]) + product(EEt[r][1], E[1][c]) + product(EEt[r][2], E[2][c]);
    }
  }
  const auto minor = [&E](int c1, int c2) -> Quadratic {
    return product(E[0][c1], E[1][c2]) - product(E[0][c2], E[1][c1]);
  };
  rows.row(9) = product(minor(1, 2), E[2][0]) + product(minor(2, 0), E[2][1]) + product(minor(0, 1), E[2][2]);
  return rows;
}

}  // namespace

namespace {

/// Gauss-Jordan elimination, pivots sought in all of the rows and in the first `columns` columns that are
/// left. By plain loops: Eigen's decompositions take the compiler five seconds each.
/// @param order  out: the first Rows are the columns that became unit vectors, in the order of the rows
/// @return false when the rows depend on each other
template <int Rows, int Cols>
bool eliminate(Eigen::Matrix<double, Rows, Cols>& M, int columns, int (&order)[Cols]) {
  std::iota(std::begin(order), std::end(order), 0);
  double largest_pivot = 0;
  for (int k = 0; k < Rows; ++k) {
    int pivot_row = k, pivot = k;
    for (int r = k; r < Rows; ++r) {
      for (int c = k; c < columns; ++c) {
        if (std::abs(M(r, order[c])) > std::abs(M(pivot_row, order[pivot]))) pivot_row = r, pivot = c;
      }
    }
    std::swap(order[k], order[pivot]);
    for (int c = 0; c < Cols; ++c) std::swap(M(k, c), M(pivot_row, c));
    const double value = M(k, order[k]);
    largest_pivot = std::max(largest_pivot, std::abs(value));
    if (!(std::abs(value) > Rows * std::numeric_limits<double>::epsilon() * largest_pivot)) return false;
    for (int c = 0; c < Cols; ++c) M(k, c) /= value;
    for (int r = 0; r < Rows; ++r) {
      const double factor = M(r, order[k]);
      if (r == k || factor == 0) continue;
      for (int c = 0; c < Cols; ++c) M(r, c) -= factor * M(k, c);
    }
  }
  return true;
}

/// Four orthonormal 3x3 matrices that span what A, of rows b a^T, says nothing of.
bool find_null_space(Eigen::Matrix<double, 5, 9> A, std::array<Matrix3, 4>& N) {
  int order[9];
  if (!eliminate(A, 9, order)) return false;
  for (int k = 0; k < 4; ++k) {
    N[k].setZero();
    N[k](order[5 + k] / 3, order[5 + k] % 3) = 1;
    for (int r = 0; r < 5; ++r) N[k](order[r] / 3, order[r] % 3) = -A(r, order[5 + k]);
    for (int pass = 0; pass < 2; ++pass) {  // Gram and Schmidt, twice to be orthogonal to all digits
      for (int j = 0; j < k; ++j) N[k] -= N[j].cwiseProduct(N[k]).sum() * N[j];
      N[k] /= N[k].norm();
    }
  }
  // The last one's share of E must not be zero. It would be where it stands for an entry of E that is, as the
  // diagonal's are without a rotation: all four are mixed, by a reflection without any symmetry.
  const double v[4] = {0.31, 0.47, 0.59, 0.58};
  Matrix3 along = Matrix3::Zero();
  for (int k = 0; k < 4; ++k) along += v[k] * N[k];
  const double norm2 = v[0] * v[0] + v[1] * v[1] + v[2] * v[2] + v[3] * v[3];
  for (int k = 0; k < 4; ++k) N[k] -= 2 * v[k] / norm2 * along;
  return true;
}

/// B(z) = B[0] + B[1] z + .. + B[4] z^4, with B(z) (x, y, 1)^T = 0 for every solution of the constraints.
///
/// Eliminating ten monomials leaves, for x^2, y^2 and x y each, two rows: one for the monomial and one for z
/// times it. The former times z, taken from the latter, is linear in x and y  (Nister, PAMI 2004).
bool hidden_variable_matrix(const Constraints& constraints, Matrix3 (&B)[5]) {
  using five_point::kMonomials;
  constexpr std::array<five_point::Exponents, 20> kOrder{
      {{2, 0, 1}, {2, 0, 0}, {0, 2, 1}, {0, 2, 0}, {1, 1, 1}, {1, 1, 0}, {3, 0, 0},
       {2, 1, 0}, {1, 2, 0}, {0, 3, 0}, {1, 0, 2}, {1, 0, 1}, {1, 0, 0}, {0, 1, 2},
       {0, 1, 1}, {0, 1, 0}, {0, 0, 3}, {0, 0, 2}, {0, 0, 1}, {0, 0, 0}}};
  Constraints C;
  for (int k = 0; k < 20; ++k) {
    const auto at = std::find(kMonomials.begin(), kMonomials.end(), kOrder[static_cast<std::size_t>(k)]);
    C.col(k) = constraints.col(static_cast<int>(at - kMonomials.begin()));
  }
  int order[20];
  if (!eliminate(C, 10, order)) return false;
  int row_of[20] = {};
  for (int r = 0; r < 10; ++r) row_of[order[r]] = r;
  for (Matrix3& power : B) power.setZero();
  for (int r = 0; r < 3; ++r) {
    const auto above = C.row(row_of[2 * r]), below = C.row(row_of[2 * r + 1]);  // with z, without
    int at = 10;
    for (int c = 0; c < 3; ++c) {
      for (int power = c < 2 ? 2 : 3; power >= 0; --power, ++at) {
        B[power](r, c) += above[at];
        B[power + 1](r, c) -= below[at];
      }
    }
  }
  return true;
}

/// Of a 3x3 matrix of polynomials whose columns have degree 3, 3 and 4; the coefficient of z^i at i.
std::array<double, 11> determinant_of(const Matrix3 (&B)[5]) {
  std::array<double, 11> sum{};
  for (int i = 0; i < 4; ++i) {
    for (int j = 0; j < 4; ++j) {
      const Vector3 normal = B[i].col(0).cross(B[j].col(1));
      for (int k = 0; k < 5; ++k) sum[static_cast<std::size_t>(i + j + k)] += normal.dot(B[k].col(2));
    }
  }
  return sum;
}

/// What a matrix of rank two sends to zero: the longest of its rows' cross products.
Vector3 null_vector(const Matrix3& M) {
  Vector3 best = Vector3::Zero();
  for (int r = 0; r < 3; ++r) {
    const Vector3 v = M.row(r).cross(M.row((r + 1) % 3));
    if (v.squaredNorm() > best.squaredNorm()) best = v;
  }
  return best;
}

/// Newton's steps onto the constraints themselves: roots of the determinant have lost half of their
/// digits where two of them are near each other, as they are after small motions.
Vector3 polished(const Constraints& constraints, Vector3 at) {
  for (int step = 0; step < 4; ++step) {
    Eigen::Matrix<double, 20, 1> monomials;
    Eigen::Matrix<double, 20, 3> derivatives;
    five_point::evaluate(at, monomials, derivatives);
    const Eigen::Matrix<double, 10, 1> residual = constraints * monomials;
    const Eigen::Matrix<double, 10, 3> J = constraints * derivatives;
    const Vector3 shift = Matrix3(J.transpose() * J).inverse() * (J.transpose() * residual);
    if (!shift.allFinite()) break;
    at -= shift;
    if (shift.norm() <= 1e-12 * at.norm()) break;
  }
  return at;
}

}  // namespace

void solve_five_point(std::span<const Vector3, 5> bearings_a, std::span<const Vector3, 5> bearings_b,
                      std::vector<Matrix3>& solutions) {
  Eigen::Matrix<double, 5, 9> A;  // rows: b a^T, row-major
  for (int i = 0; i < 5; ++i) {
    const Vector3 a = bearings_a[i].normalized();
    const Vector3 b = bearings_b[i].normalized();
    for (int k = 0; k < 9; ++k) A(i, k) = b[k / 3] * a[k % 3];
  }
  std::array<Matrix3, 4> N;
  if (!find_null_space(A, N)) return;

  const Constraints constraints = essential_constraints(N);
  Matrix3 B[5];
  if (!hidden_variable_matrix(constraints, B)) return;
  std::array<double, 10> roots;
  const int count = real_roots(determinant_of(B), roots);
  for (int i = 0; i < count; ++i) {
    const double z = roots[static_cast<std::size_t>(i)];
    const Vector3 v = null_vector(B[0] + z * (B[1] + z * (B[2] + z * (B[3] + z * B[4]))));
    if (v[2] == 0) continue;
    const Vector3 x = polished(constraints, Vector3(v[0] / v[2], v[1] / v[2], z));
    const Matrix3 E = x[0] * N[0] + x[1] * N[1] + x[2] * N[2] + N[3];
    const double norm = E.norm();
    if (std::isfinite(norm) && norm > 0) solutions.push_back(E * (std::sqrt(2.0) / norm));
  }
}

double squared_sampson_distance(const Matrix3& E_b_a, const Vector3& bearing_a, const Vector3& bearing_b) {
  const Vector3 a = bearing_a / bearing_a.z();
  const Vector3 b = bearing_b / bearing_b.z();
  const Vector3 line_b = E_b_a * a;
  const Vector3 line_a = E_b_a.transpose() * b;
  const double e = b.dot(line_b);
  return e * e / (line_a.head<2>().squaredNorm() + line_b.head<2>().squaredNorm());
}

std::optional<SE3> decompose_essential(const Matrix3& E_b_a, std::span<const Vector3> bearings_a,
                                       std::span<const Vector3> bearings_b, std::span<const int> indices) {
  const auto svd = decompose(E_b_a);
  if (!svd) return std::nullopt;
  Matrix3 U = svd->U;
  Matrix3 V = svd->V;
  if (U.determinant() < 0) U = -U;
  if (V.determinant() < 0) V = -V;
  Matrix3 W;
  W << 0, -1, 0, 1, 0, 0, 0, 0, 1;
  std::optional<SE3> best;
  int most = 0;
  for (const Matrix3& R : {Matrix3(U * W * V.transpose()), Matrix3(U * W.transpose() * V.transpose())}) {
    for (const double sign : {1.0, -1.0}) {
      const SE3 T_b_a(R, sign * U.col(2));
      const SE3 T_a_b = T_b_a.inverse();
      int in_front = 0;
      for (const int i : indices) {
        if (triangulate_midpoint(bearings_a[i].normalized(), bearings_b[i].normalized(), T_a_b, 0.0))
          ++in_front;
      }
      if (in_front > most) {
        most = in_front;
        best = T_b_a;
      }
    }
  }
  return best;
}

namespace {

struct FivePointEstimator {
  using Model = Matrix3;
  static constexpr int kSampleSize = 5;
  std::span<const Vector3> a, b;

  [[nodiscard]] int size() const { return static_cast<int>(std::min(a.size(), b.size())); }
  void fit(std::span<const int, 5> sample, std::vector<Matrix3>& models) const {
    std::array<Vector3, 5> sample_a, sample_b;
    for (int k = 0; k < 5; ++k) {
      sample_a[k] = a[sample[k]];
      sample_b[k] = b[sample[k]];
    }
    solve_five_point(sample_a, sample_b, models);
  }
  [[nodiscard]] double squared_residual(const Matrix3& E, int i) const {
    return squared_sampson_distance(E, a[i], b[i]);
  }
};

double sampson_cost(const SE3& T_b_a, const FivePointEstimator& data, std::span<const int> indices) {
  const Matrix3 E = essential_matrix(T_b_a);
  double cost = 0;
  for (const int i : indices) cost += data.squared_residual(E, i);
  return cost;
}

/// One Gauss-Newton step with the Sampson denominators fixed: rotation R <- exp(w) R, direction t <- t + B y.
SE3 sampson_step(const SE3& T_b_a, const FivePointEstimator& data, std::span<const int> indices) {
  using Matrix5 = Eigen::Matrix<double, 5, 5>;
  using Vector5 = Eigen::Matrix<double, 5, 1>;
  const Vector3 t = T_b_a.translation().normalized();
  Eigen::Matrix<double, 3, 2> B;  // basis of the plane perpendicular to t
  B.col(0) = t.unitOrthogonal();
  B.col(1) = t.cross(B.col(0));
  const Matrix3 R = T_b_a.rotation();
  const Matrix3 E = hat(t) * R;
  Matrix5 H = Matrix5::Zero();
  Vector5 g = Vector5::Zero();
  for (const int i : indices) {
    const Vector3 a = data.a[i] / data.a[i].z();
    const Vector3 b = data.b[i] / data.b[i].z();
    const Vector3 Ra = R * a;
    const double e = b.dot(E * a);
    const double d = (E * a).head<2>().squaredNorm() + (E.transpose() * b).head<2>().squaredNorm();
    Vector5 J;  // of b . (t x exp(w) R a)
    J << Ra.cross(b.cross(t)), B.transpose() * Ra.cross(b);
    H += J * J.transpose() / d;
    g -= J * (e / d);
  }
  const Vector5 step = H.ldlt().solve(g);
  return {SO3::exp(step.head<3>()) * T_b_a.so3(), (t + B * step.tail<2>()).normalized()};
}

}  // namespace

std::optional<RelativePose> estimate_relative_pose(std::span<const Vector3> bearings_a,
                                                   std::span<const Vector3> bearings_b,
                                                   const RansacOptions& options) {
  const FivePointEstimator data{bearings_a, bearings_b};
  const auto found = ransac(data, options);
  if (!found) return std::nullopt;
  const auto start = decompose_essential(found->model, bearings_a, bearings_b, found->inliers);
  if (!start) return std::nullopt;

  constexpr int kMaxSteps = 10;
  RelativePose result{*start, found->inliers};
  double cost = sampson_cost(result.T_b_a, data, result.inliers);
  for (int step = 0; step < kMaxSteps; ++step) {
    const SE3 T_new = sampson_step(result.T_b_a, data, result.inliers);
    const double cost_new = sampson_cost(T_new, data, result.inliers);
    if (!(cost_new < cost)) break;
    const bool converged = cost_new > (1 - 1e-9) * cost;
    result.T_b_a = T_new;
    cost = cost_new;
    if (converged) break;
  }
  const Matrix3 E = essential_matrix(result.T_b_a);
  result.inliers.clear();
  for (int i = 0; i < data.size(); ++i) {
    if (data.squared_residual(E, i) <= options.threshold * options.threshold) result.inliers.push_back(i);
  }
  return result;
}

}  // namespace twofold
