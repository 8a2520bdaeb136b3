#include "sparse/block_cholesky.hpp"

#include <Eigen/OrderingMethods>
#include <Eigen/SparseCore>
#include <algorithm>
#include <array>
#include <utility>

#include "base/check.hpp"
#include "sparse/block_kernels.hpp"

namespace twofold {
namespace {

/// resize() alone takes twice the memory when one element is missing, and these live as long as the solver.
template <class T>
void resize_exactly(std::vector<T>& values, std::size_t size) {
  values.reserve(size);
  values.resize(size);
}

}  // namespace

void BlockCholesky::set_pattern(CouplingPattern pattern) {
  if (pattern == pattern_ && !column_begin_.empty()) return;
  pattern_ = std::move(pattern);
  choose_order();
  find_fill();
}

/// Minimum degree (AMD).
void BlockCholesky::choose_order() {
  const int n = pattern_.size();
  order_.resize(n);
  position_.resize(n);
  if (n == 0) return;
  std::vector<int> begin{0}, row;
  for (int i = 0; i < n; ++i) {
    row.push_back(i);
    pattern_.for_each_after(i, [&](int j) { row.push_back(j); });
    begin.push_back(static_cast<int>(row.size()));
  }
  const std::vector<double> values(row.size(), 1.0);
  const Eigen::Map<const Eigen::SparseMatrix<double>> lower(n, n, begin.back(), begin.data(), row.data(),
                                                            values.data());
  Eigen::PermutationMatrix<Eigen::Dynamic, Eigen::Dynamic, int> permutation(n);
  Eigen::AMDOrdering<int>()(lower.selfadjointView<Eigen::Lower>(), permutation);
  for (int k = 0; k < n; ++k) order_[k] = permutation.indices()[k];
  for (int k = 0; k < n; ++k) position_[order_[k]] = k;
}

/// Column j of the factor has the rows of the matrix's column and those of the columns whose first row below
/// the diagonal is j (its children in the elimination tree).
void BlockCholesky::find_fill() {
  const int n = size();
  CouplingPattern fill(n);
  for (int i = 0; i < n; ++i) {
    pattern_.for_each_after(i, [&](int j) { fill.couple(position_[i], position_[j]); });
  }
  std::vector<int> row_count(n, 0);
  column_begin_.assign(1, 0);
  row_.clear();
  for (int j = 0; j < n; ++j) {
    row_.push_back(j);
    fill.for_each_after(j, [&](int i) {
      row_.push_back(i);
      ++row_count[i];
    });
    const int first = column_begin_[j] + 1, end = static_cast<int>(row_.size());
    if (first < end) fill.inherit(row_[first], j);
    column_begin_.push_back(end);
  }
  row_begin_.assign(n + 1, 0);
  for (int k = 0; k < n; ++k) row_begin_[k + 1] = row_begin_[k] + row_count[k];
  resize_exactly(row_entries_, static_cast<std::size_t>(row_begin_[n]));
  std::vector<int> next(row_begin_.begin(), row_begin_.end() - 1);
  for (int j = 0; j < n; ++j) {
    for (int b = column_begin_[j] + 1; b < column_begin_[j + 1]; ++b) row_entries_[next[row_[b]]++] = {j, b};
  }
  resize_exactly(blocks_, row_.size());
  inverse_diagonal_.resize(n);
  place_.assign(n, -1);
  continues_.assign(n, 0);
  for (int j = 0; j + 1 < n; ++j) {
    const int height = column_begin_[j + 1] - column_begin_[j];
    continues_[j] = height > 1 && row_[column_begin_[j] + 1] == j + 1 &&
                    column_begin_[j + 2] - column_begin_[j + 1] == height - 1;
  }
}

int BlockCholesky::block_index(int row, int column) const {
  const auto begin = row_.begin() + column_begin_[column];
  const auto end = row_.begin() + column_begin_[column + 1];
  const auto found = std::lower_bound(begin, end, row);
  TWOFOLD_CHECK(found != end && *found == row, "block outside of the pattern");
  return static_cast<int>(found - row_.begin());
}

void BlockCholesky::block_indices(int column, std::span<const int> rows, std::span<int> blocks) {
  const int begin = column_begin_[column], end = column_begin_[column + 1];
  for (int b = begin; b < end; ++b) place_[row_[b]] = b;
  for (std::size_t k = 0; k < rows.size(); ++k) {
    const int b = place_[rows[k]];  // that of a column looked at before does not count
    blocks[k] = b >= begin && b < end ? b : -1;
  }
}

void BlockCholesky::set_zero() {
  set_all_zero(blocks_.data(), blocks_.size());
}

/// Left-looking: column k takes what all finished columns with a block in row k owe to it; of columns that go
/// on in the same rows up to four at once, while the block that takes it waits in registers.
bool BlockCholesky::factorise() {
  const int n = size();
  for (int k = 0; k < n; ++k) {
    const int begin = column_begin_[k];
    const int end = column_begin_[k + 1];
    for (int b = begin; b < end; ++b) place_[row_[b]] = b;
    const auto row = std::span<const RowEntry>(row_entries_)
                         .subspan(row_begin_[k], static_cast<std::size_t>(row_begin_[k + 1] - row_begin_[k]));
    for (std::size_t e = 0; e < row.size();) {
      std::size_t count = 1;
      while (count < 4 && e + count < row.size() && continues_[row[e + count - 1].column]) ++count;
      if (count == 4) {
        subtract_products<4>(row.subspan(e, 4));
      } else if (count >= 2) {
        subtract_products<2>(row.subspan(e, count = 2));
      } else {
        subtract_products<1>(row.subspan(e, 1));
      }
      e += count;
    }
    if (!factorise_diagonal<6>(blocks_[begin], inverse_diagonal_[k])) return false;
    for (int b = begin + 1; b < end; ++b) {
      Matrix6 L_ik = Matrix6::Zero();
      add_outer_product<1, 6>(L_ik.data(), blocks_[b].data(), inverse_diagonal_[k].data());
      blocks_[b] = L_ik;
    }
  }
  return true;
}

/// From the column whose rows are in place_, what these columns owe to it, which have the same rows from
/// there on.
template <std::size_t kColumns>
void BlockCholesky::subtract_products(std::span<const RowEntry> columns) {
  std::array<const Matrix6*, kColumns> L_i, L_k;
  for (std::size_t c = 0; c < kColumns; ++c) L_i[c] = L_k[c] = &blocks_[columns[c].block];
  const auto [j, first] = columns[0];
  for (int b = first; b < column_begin_[j + 1]; ++b) {
    Packet4 acc[9];
    double* target = blocks_[place_[row_[b]]].data();
    load_block(acc, target);
#pragma GCC unroll 4
    for (std::size_t c = 0; c < kColumns; ++c) {
      accumulate_outer_products<-1, 6>(acc, L_i[c]->data(), L_k[c]->data());
      ++L_i[c];
    }
    store_block(acc, target);
  }
}

void BlockCholesky::solve(std::span<Vector6> rhs) const {
  solve_lower(rhs);
  solve_upper(rhs);
}

void BlockCholesky::solve_lower(std::span<Vector6> rhs) const {
  for (int j = 0; j < size(); ++j) {
    const Vector6 x = inverse_diagonal_[j] * rhs[j];
    rhs[j] = x;
    for (int b = column_begin_[j] + 1; b < column_begin_[j + 1]; ++b) {
      rhs[row_[b]].noalias() -= blocks_[b] * x;
    }
  }
}

void BlockCholesky::solve_upper(std::span<Vector6> rhs) const {
  for (int j = size() - 1; j >= 0; --j) {
    Vector6 x = rhs[j];
    for (int b = column_begin_[j] + 1; b < column_begin_[j + 1]; ++b) {
      x.noalias() -= blocks_[b].transpose() * rhs[row_[b]];
    }
    rhs[j].noalias() = inverse_diagonal_[j].transpose() * x;
  }
}

}  // namespace twofold
