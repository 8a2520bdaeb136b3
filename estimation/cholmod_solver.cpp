#include "estimation/cholmod_solver.hpp"

#include <cholmod.h>
#include <omp.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <set>

#include "geometry/check.hpp"

// Present when the BLAS is OpenBLAS.
extern "C" [[gnu::weak]] void openblas_set_num_threads(int);

namespace twofold {
namespace {

/// Keeps OpenMP to the calling thread. CHOLMOD's supernodal code asks for four threads at every small copy
/// loop, whatever omp_set_num_threads says; they spin on the cores other threads need. The setting belongs to
/// the calling thread.
class OneThread {
 public:
  OneThread() : levels_(omp_get_max_active_levels()) { omp_set_max_active_levels(0); }
  ~OneThread() { omp_set_max_active_levels(levels_); }
  OneThread(const OneThread&) = delete;
  OneThread& operator=(const OneThread&) = delete;

 private:
  int levels_;
};

/// Silent CHOLMOD workspace.
struct Common {
  Common() {
    if (openblas_set_num_threads != nullptr) openblas_set_num_threads(1);
    cholmod_start(&c);
    c.print = 0;
    c.error_handler = nullptr;
  }
  ~Common() { cholmod_finish(&c); }
  Common(const Common&) = delete;
  Common& operator=(const Common&) = delete;
  cholmod_common c;
};

/// View of a compressed lower triangle; x may be null for a pattern.
cholmod_sparse lower_triangle(int n, std::vector<int>& begin, std::vector<int>& row, double* x) {
  cholmod_sparse A{};
  A.nrow = A.ncol = n;
  A.nzmax = row.size();
  A.p = begin.data();
  A.i = row.data();
  A.x = x;
  A.stype = -1;
  A.itype = CHOLMOD_INT;
  A.xtype = x ? CHOLMOD_REAL : CHOLMOD_PATTERN;
  A.dtype = CHOLMOD_DOUBLE;
  A.sorted = A.packed = 1;
  return A;
}

/// Sorted rows below the diagonal of each column, without repetitions.
std::vector<std::vector<int>> lower_neighbours(int nodes, std::span<const std::pair<int, int>> edges) {
  std::vector<std::vector<int>> below(nodes);
  for (const auto& [i, j] : edges) {
    TWOFOLD_CHECK(i != j && i >= 0 && j >= 0 && i < nodes && j < nodes, "edge joins two different nodes");
    below[std::min(i, j)].push_back(std::max(i, j));
  }
  for (auto& rows : below) {
    std::sort(rows.begin(), rows.end());
    rows.erase(std::unique(rows.begin(), rows.end()), rows.end());
  }
  return below;
}

}  // namespace

std::vector<int> elimination_order(int nodes, std::span<const std::pair<int, int>> edges, int block_size) {
  // Flops from which nested dissection may earn back its own time, which is several times that of minimum
  // degree.
  constexpr double kWorthDissecting = 2e7;
  std::vector<int> begin{0}, row;
  const auto below = lower_neighbours(nodes, edges);
  for (int j = 0; j < nodes; ++j) {
    row.push_back(j);
    row.insert(row.end(), below[j].begin(), below[j].end());
    begin.push_back(static_cast<int>(row.size()));
  }
  cholmod_sparse A = lower_triangle(nodes, begin, row, nullptr);
  std::vector<int> best(nodes);
  for (int i = 0; i < nodes; ++i) best[i] = i;
  double fewest_flops = std::numeric_limits<double>::infinity();
  const double block_flops = std::pow(block_size, 3);
  for (const int ordering : {CHOLMOD_AMD, CHOLMOD_METIS}) {
    if (ordering == CHOLMOD_METIS && fewest_flops * block_flops < kWorthDissecting) break;
    Common common;
    common.c.nmethods = 1;
    common.c.method[0].ordering = ordering;
    common.c.postorder = 1;
    common.c.supernodal = CHOLMOD_SIMPLICIAL;  // symbolic work on single nodes only
    cholmod_factor* L = cholmod_analyze(&A, &common.c);
    if (L != nullptr && common.c.fl < fewest_flops) {
      fewest_flops = common.c.fl;
      std::copy_n(static_cast<const int*>(L->Perm), nodes, best.begin());
    }
    cholmod_free_factor(&L, &common.c);
  }
  return best;
}

struct CholmodSolver::Cholmod {
  Common common;
  cholmod_factor* L = nullptr;
  std::vector<double> damped;  // values of A + damping diag(A)
  cholmod_dense* X = nullptr;  // kept between solves
  cholmod_dense* Y = nullptr;
  cholmod_dense* E = nullptr;

  ~Cholmod() {
    cholmod_free_factor(&L, &common.c);
    cholmod_free_dense(&X, &common.c);
    cholmod_free_dense(&Y, &common.c);
    cholmod_free_dense(&E, &common.c);
  }
};

CholmodSolver::CholmodSolver() = default;
CholmodSolver::~CholmodSolver() = default;
CholmodSolver::CholmodSolver(CholmodSolver&&) noexcept = default;
CholmodSolver& CholmodSolver::operator=(CholmodSolver&&) noexcept = default;

std::vector<CholmodSolver::Slot> CholmodSolver::set_pattern(int block_size, std::span<const int> order,
                                                            std::span<const std::pair<int, int>> edges) {
  const int blocks = static_cast<int>(order.size());
  block_size_ = block_size;
  position_.resize(blocks);
  for (int k = 0; k < blocks; ++k) position_[order[k]] = k;
  std::vector<std::pair<int, int>> ordered_edges;
  for (const auto& [i, j] : edges) ordered_edges.emplace_back(position_[i], position_[j]);
  const auto below = lower_neighbours(blocks, ordered_edges);

  column_begin_.assign(1, 0);
  row_.clear();
  for (int j = 0; j < blocks; ++j) {
    for (int c = 0; c < block_size; ++c) {
      for (int r = c; r < block_size; ++r) row_.push_back(j * block_size + r);
      for (const int i : below[j]) {
        for (int r = 0; r < block_size; ++r) row_.push_back(i * block_size + r);
      }
      column_begin_.push_back(static_cast<int>(row_.size()));
    }
  }
  values_.assign(row_.size(), 0.0);

  cholmod_ = std::make_unique<Cholmod>();
  cholmod_common& c = cholmod_->common.c;
  c.nmethods = 1;
  c.method[0].ordering = CHOLMOD_NATURAL;  // the blocks stand in elimination order already
  c.postorder = 0;
  c.supernodal = CHOLMOD_SUPERNODAL;
  cholmod_sparse A = lower_triangle(dimension(), column_begin_, row_, values_.data());
  cholmod_->L = cholmod_analyze(&A, &c);
  TWOFOLD_CHECK(cholmod_->L != nullptr || dimension() == 0, "symbolic analysis runs out of memory only");

  std::vector<Slot> slots;
  slots.reserve(edges.size());
  for (const auto& [i, j] : ordered_edges) {
    const auto& rows = below[std::min(i, j)];
    const auto place = std::lower_bound(rows.begin(), rows.end(), std::max(i, j)) - rows.begin();
    slots.push_back({std::min(i, j), static_cast<int>(place), i < j});
  }
  return slots;
}

double CholmodSolver::factor_entries() const {
  return cholmod_ ? cholmod_->common.c.lnz : 0;
}

void CholmodSolver::set_zero() {
  std::fill(values_.begin(), values_.end(), 0.0);
}

bool CholmodSolver::factorise(double damping) {
  if (dimension() == 0) return true;
  const OneThread one_thread;
  double* values = values_.data();
  if (damping > 0) {
    cholmod_->damped = values_;
    for (int c = 0; c < dimension(); ++c) cholmod_->damped[column_begin_[c]] *= 1 + damping;
    values = cholmod_->damped.data();
  }
  cholmod_sparse A = lower_triangle(dimension(), column_begin_, row_, values);
  cholmod_common& c = cholmod_->common.c;
  c.quick_return_if_not_posdef = 1;
  cholmod_factorize(&A, cholmod_->L, &c);
  return c.status == CHOLMOD_OK && cholmod_->L->minor == cholmod_->L->n;
}

Eigen::MatrixXd CholmodSolver::solve(const Eigen::MatrixXd& b) {
  TWOFOLD_CHECK(b.rows() == dimension(), "one row per unknown");
  const int n = block_size_;
  Eigen::MatrixXd ordered(b.rows(), b.cols());
  for (std::size_t i = 0; i < position_.size(); ++i) {
    ordered.middleRows(position_[i] * n, n) = b.middleRows(static_cast<Eigen::Index>(i) * n, n);
  }
  if (b.size() == 0) return ordered;
  const OneThread one_thread;
  cholmod_dense B{};
  B.nrow = B.d = ordered.rows();
  B.ncol = ordered.cols();
  B.nzmax = ordered.size();
  B.x = ordered.data();
  B.xtype = CHOLMOD_REAL;
  B.dtype = CHOLMOD_DOUBLE;
  const int ok = cholmod_solve2(CHOLMOD_A, cholmod_->L, &B, nullptr, &cholmod_->X, nullptr, &cholmod_->Y,
                                &cholmod_->E, &cholmod_->common.c);
  TWOFOLD_CHECK(ok, "a factor exists");
  const Eigen::Map<const Eigen::MatrixXd> X(static_cast<const double*>(cholmod_->X->x), b.rows(), b.cols());
  Eigen::MatrixXd x(b.rows(), b.cols());
  for (std::size_t i = 0; i < position_.size(); ++i) {
    x.middleRows(static_cast<Eigen::Index>(i) * n, n) = X.middleRows(position_[i] * n, n);
  }
  return x;
}

}  // namespace twofold
