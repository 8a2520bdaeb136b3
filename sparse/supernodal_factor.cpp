#include <algorithm>
#include <memory>
#include <vector>

#include "base/check.hpp"
#include "sparse/block_factor.hpp"
#include "sparse/block_kernels.hpp"
#include "sparse/panel_structure.hpp"

namespace twofold {
namespace {

/// Left-looking, panel by panel. Each row of blocks of a panel is one strip, N x (N width) and column-major.
/// All work is products of two strips: one kernel, whose result waits in registers to the end, and goes to
/// its place in the target straight away. No dense panels are gathered for a BLAS, and none is scattered.
template <int N>
class SupernodalFactor final : public BlockFactor {
 public:
  explicit SupernodalFactor(const BlockStructure& structure)
      : s_(structure),
        p_(gather_panels(structure)),
        values_(std::make_unique_for_overwrite<double[]>(kEntries * p_.blocks + kStripOverrun)),
        inverse_diagonal_(structure.order.size()),
        place_(structure.order.size()) {}

  bool factorise(std::span<const double> blocks, double damping) override {
    for (std::size_t k = 0; k < p_.panels.size(); ++k) {
      const Panel& panel = p_.panels[k];
      load(panel, blocks, damping);
      for (int u = p_.update_begin[k]; u < p_.update_begin[k + 1]; ++u) take_update(panel, p_.updates[u]);
      if (!factorise_panel(panel)) return false;
    }
    return true;
  }

  void solve(Eigen::MatrixXd& x) override {
    for (Eigen::Index c = 0; c < x.cols(); ++c) {
      double* x_c = x.col(c).data();
      for (auto panel = p_.panels.begin(); panel != p_.panels.end(); ++panel) solve_lower(*panel, x_c);
      for (auto panel = p_.panels.rbegin(); panel != p_.panels.rend(); ++panel) solve_upper(*panel, x_c);
    }
  }

 private:
  using Panel = PanelStructure::Panel;
  using Block = Eigen::Matrix<double, N, N>;
  using Vector = Eigen::Matrix<double, N, 1>;
  static constexpr std::size_t kEntries = N * N;

  [[nodiscard]] double* strip(const Panel& panel, int i) const {
    return values_.get() + kEntries * (panel.blocks + static_cast<std::size_t>(i) * panel.width);
  }
  [[nodiscard]] Eigen::Map<Block> block(const Panel& panel, int i, int j) const {
    return Eigen::Map<Block>(strip(panel, i) + kEntries * j);
  }

  /// Values of the system into the panel, and its rows into place_.
  void load(const Panel& panel, std::span<const double> blocks, double damping) {
    std::fill_n(strip(panel, 0), kEntries * panel.width * panel.height(), 0.0);
    for (int i = 0; i < panel.height(); ++i) place_[p_.row[panel.begin + i]] = i;
    for (int j = 0; j < panel.width; ++j) {
      const int column = panel.first + j;
      for (int b = s_.system_begin[column]; b < s_.system_begin[column + 1]; ++b) {
        block(panel, place_[s_.system_row[b]], j) = Eigen::Map<const Block>(blocks.data() + kEntries * b);
      }
      block(panel, j, j).diagonal() *= 1 + damping;
    }
  }

  void take_update(const Panel& panel, const PanelStructure::Update& update) {
    const Panel& source = p_.panels[update.panel];
    const int* row = p_.row.data() + source.begin;
    for (int j = update.begin; j < update.end; ++j) {
      for (int i = j; i < source.height(); ++i) {
        subtract_strip_product<N>(block(panel, place_[row[i]], row[j] - panel.first).data(), strip(source, i),
                                  strip(source, j), N * source.width);
      }
    }
  }

  bool factorise_panel(const Panel& panel) {
    for (int j = 0; j < panel.width; ++j) {
      for (int i = j; i < panel.height(); ++i) {
        subtract_strip_product<N>(block(panel, i, j).data(), strip(panel, i), strip(panel, j), N * j);
      }
      Block L_jj = block(panel, j, j);
      Block& inverse = inverse_diagonal_[panel.first + j];
      if (!factorise_diagonal<N>(L_jj, inverse)) return false;
      block(panel, j, j) = L_jj;
      for (int i = j + 1; i < panel.height(); ++i) {
        const Block A_ij = block(panel, i, j);
        assign_product(A_ij, inverse, block(panel, i, j));
      }
    }
    return true;
  }
  /// C = A B^T
  static void assign_product(const Block& A, const Block& B, Eigen::Map<Block> C) {
    if constexpr (N == 6) {
      C.setZero();
      add_outer_product<1, 6>(C.data(), A.data(), B.data());
    } else {
      C.noalias() = A.lazyProduct(B.transpose());
    }
  }

  void solve_lower(const Panel& panel, double* x) const {
    double* x_p = x + N * panel.first;
    for (int i = 0; i < panel.height(); ++i) {
      Eigen::Map<Vector> x_i(x + N * p_.row[panel.begin + i]);
      const double* L_i = strip(panel, i);
      Vector rest = x_i;
      for (int k = 0; k < N * std::min(i, panel.width); ++k) {
        rest -= x_p[k] * Eigen::Map<const Vector>(L_i + N * k);
      }
      if (i < panel.width) {
        x_i.noalias() = inverse_diagonal_[panel.first + i].lazyProduct(rest);
      } else {
        x_i = rest;
      }
    }
  }
  void solve_upper(const Panel& panel, double* x) const {
    double* x_p = x + N * panel.first;
    for (int i = panel.height() - 1; i >= 0; --i) {
      Eigen::Map<Vector> x_i(x + N * p_.row[panel.begin + i]);
      const double* L_i = strip(panel, i);
      const Vector known = i < panel.width
                               ? Vector(inverse_diagonal_[panel.first + i].transpose().lazyProduct(x_i))
                               : Vector(x_i);
      x_i = known;
      for (int k = 0; k < N * std::min(i, panel.width); ++k) {
        x_p[k] -= known.dot(Eigen::Map<const Vector>(L_i + N * k));
      }
    }
  }

  const BlockStructure& s_;
  PanelStructure p_;
  std::unique_ptr<double[]> values_;
  std::vector<Block> inverse_diagonal_;  // L_jj^-1, lower triangular
  std::vector<int> place_;               // scratch: where a row is in the present panel
};

}  // namespace

std::unique_ptr<BlockFactor> make_supernodal_factor(const BlockStructure& structure, int block_size) {
  switch (block_size) {
    case 1:
      return std::make_unique<SupernodalFactor<1>>(structure);
    case 2:
      return std::make_unique<SupernodalFactor<2>>(structure);
    case 3:
      return std::make_unique<SupernodalFactor<3>>(structure);
    case 6:
      return std::make_unique<SupernodalFactor<6>>(structure);
    case 7:
      return std::make_unique<SupernodalFactor<7>>(structure);
    default:
      TWOFOLD_CHECK(false, "block size is 1, 2, 3, 6 or 7");
  }
  return nullptr;
}

}  // namespace twofold
