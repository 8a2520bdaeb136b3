#include <vector>

#include "base/check.hpp"
#include "sparse/block_factor.hpp"
#include "sparse/block_kernels.hpp"

namespace twofold {
namespace {

/// C -= A B^T
template <int N>
void subtract_product(Eigen::Matrix<double, N, N>& C, const Eigen::Matrix<double, N, N>& A,
                      const Eigen::Matrix<double, N, N>& B) {
  if constexpr (N == 6) {
    add_outer_product<-1, 6>(C.data(), A.data(), B.data());
  } else {
    C.noalias() -= A.lazyProduct(B.transpose());
  }
}

/// Left-looking: column k takes what all finished columns with a block in row k owe to it. Every block
/// product is one kernel of fixed size.
template <int N>
class SimplicialFactor final : public BlockFactor {
 public:
  explicit SimplicialFactor(const BlockStructure& structure)
      : s_(structure),
        factor_(structure.factor_row.size()),
        inverse_diagonal_(structure.order.size()),
        place_(structure.order.size()) {}

  bool factorise(std::span<const double> blocks, double damping) override {
    set_all_zero(factor_.data(), factor_.size());
    for (std::size_t b = 0; b < s_.factor_block.size(); ++b) {
      factor_[s_.factor_block[b]] = Eigen::Map<const Block>(blocks.data() + kEntries * b);
    }
    for (int k = 0; k < s_.nodes(); ++k) {
      Block& diagonal = factor_[s_.factor_begin[k]];
      diagonal.diagonal() *= 1 + damping;
      if (!factorise_column(k)) return false;
    }
    return true;
  }

  void solve(Eigen::MatrixXd& x) override {
    for (Eigen::Index c = 0; c < x.cols(); ++c) {
      solve_lower(x.col(c).data());
      solve_upper(x.col(c).data());
    }
  }

 private:
  using Block = Eigen::Matrix<double, N, N>;
  using Row = Eigen::Map<Eigen::Matrix<double, N, 1>>;
  static constexpr std::size_t kEntries = N * N;

  bool factorise_column(int k) {
    const int begin = s_.factor_begin[k], end = s_.factor_begin[k + 1];
    for (int b = begin; b < end; ++b) place_[s_.factor_row[b]] = b;
    for (int e = s_.row_begin[k]; e < s_.row_begin[k + 1]; ++e) {
      const auto [j, first] = s_.row_entries[e];
      const Block& L_kj = factor_[first];
      for (int b = first; b < s_.factor_begin[j + 1]; ++b) {
        subtract_product<N>(factor_[place_[s_.factor_row[b]]], factor_[b], L_kj);
      }
    }
    if (!factorise_diagonal<N>(factor_[begin], inverse_diagonal_[k])) return false;
    for (int b = begin + 1; b < end; ++b) {
      const Block A_ik = factor_[b];
      factor_[b].setZero();
      subtract_product<N>(factor_[b], A_ik, negative_inverse(k));
    }
    return true;
  }
  [[nodiscard]] Block negative_inverse(int k) const { return -inverse_diagonal_[k]; }

  void solve_lower(double* x) const {
    for (int j = 0; j < s_.nodes(); ++j) {
      Row x_j(x + N * j);
      x_j = (inverse_diagonal_[j].lazyProduct(x_j)).eval();
      for (int b = s_.factor_begin[j] + 1; b < s_.factor_begin[j + 1]; ++b) {
        Row(x + N * s_.factor_row[b]).noalias() -= factor_[b].lazyProduct(x_j);
      }
    }
  }
  void solve_upper(double* x) const {
    for (int j = s_.nodes() - 1; j >= 0; --j) {
      Eigen::Matrix<double, N, 1> x_j = Row(x + N * j);
      for (int b = s_.factor_begin[j] + 1; b < s_.factor_begin[j + 1]; ++b) {
        x_j.noalias() -= factor_[b].transpose().lazyProduct(Row(x + N * s_.factor_row[b]));
      }
      Row(x + N * j).noalias() = inverse_diagonal_[j].transpose().lazyProduct(x_j);
    }
  }

  const BlockStructure& s_;
  std::vector<Block> factor_;
  std::vector<Block> inverse_diagonal_;  // L_jj^-1, lower triangular
  std::vector<int> place_;               // scratch: block of a row in the present column
};

}  // namespace

std::unique_ptr<BlockFactor> make_simplicial_factor(const BlockStructure& structure, int block_size) {
  switch (block_size) {
    case 1:
      return std::make_unique<SimplicialFactor<1>>(structure);
    case 2:
      return std::make_unique<SimplicialFactor<2>>(structure);
    case 3:
      return std::make_unique<SimplicialFactor<3>>(structure);
    case 6:
      return std::make_unique<SimplicialFactor<6>>(structure);
    case 7:
      return std::make_unique<SimplicialFactor<7>>(structure);
    default:
      TWOFOLD_CHECK(false, "block size is 1, 2, 3, 6 or 7");
  }
  return nullptr;
}

}  // namespace twofold
