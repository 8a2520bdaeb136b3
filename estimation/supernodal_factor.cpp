#include <algorithm>
#include <vector>

#include "estimation/block_factor.hpp"
#include "estimation/cholmod_common.hpp"
#include "geometry/check.hpp"

namespace twofold {
namespace {

/// The blocks stand in elimination order already; CHOLMOD gets them as a compressed lower triangle of
/// scalars.
class SupernodalFactor final : public BlockFactor {
 public:
  SupernodalFactor(const BlockStructure& structure, int block_size) : s_(structure), n_(block_size) {
    begin_.push_back(0);
    row_.reserve(structure.system_row.size() * block_size * block_size);
    for (int j = 0; j < s_.nodes(); ++j) {
      for (int c = 0; c < n_; ++c) {
        for (int r = c; r < n_; ++r) row_.push_back(j * n_ + r);
        for (int b = s_.system_begin[j] + 1; b < s_.system_begin[j + 1]; ++b) {
          for (int r = 0; r < n_; ++r) row_.push_back(s_.system_row[b] * n_ + r);
        }
        begin_.push_back(static_cast<int>(row_.size()));
      }
    }
    values_.resize(row_.size());
    common_.c.nmethods = 1;
    common_.c.method[0].ordering = CHOLMOD_NATURAL;
    common_.c.postorder = 0;
    common_.c.supernodal = CHOLMOD_SUPERNODAL;
    common_.c.quick_return_if_not_posdef = 1;
    cholmod_sparse A = lower_triangle_view(dimension(), begin_, row_, nullptr);
    L_ = cholmod_analyze(&A, &common_.c);
    TWOFOLD_CHECK(L_ != nullptr || dimension() == 0, "symbolic analysis runs out of memory only");
  }
  ~SupernodalFactor() override {
    cholmod_free_factor(&L_, &common_.c);
    cholmod_free_dense(&X_, &common_.c);
    cholmod_free_dense(&Y_, &common_.c);
    cholmod_free_dense(&E_, &common_.c);
  }
  SupernodalFactor(const SupernodalFactor&) = delete;
  SupernodalFactor& operator=(const SupernodalFactor&) = delete;

  bool factorise(std::span<const double> blocks, double damping) override {
    if (dimension() == 0) return true;
    fill(blocks, damping);
    const OneThread one_thread;
    cholmod_sparse A = lower_triangle_view(dimension(), begin_, row_, values_.data());
    cholmod_factorize(&A, L_, &common_.c);
    return common_.c.status == CHOLMOD_OK && L_->minor == L_->n;
  }

  void solve(Eigen::MatrixXd& x) override {
    if (x.size() == 0) return;
    const OneThread one_thread;
    cholmod_dense B{};
    B.nrow = B.d = x.rows();
    B.ncol = x.cols();
    B.nzmax = x.size();
    B.x = x.data();
    B.xtype = CHOLMOD_REAL;
    B.dtype = CHOLMOD_DOUBLE;
    const int ok = cholmod_solve2(CHOLMOD_A, L_, &B, nullptr, &X_, nullptr, &Y_, &E_, &common_.c);
    TWOFOLD_CHECK(ok, "a factor exists");
    x = Eigen::Map<const Eigen::MatrixXd>(static_cast<const double*>(X_->x), x.rows(), x.cols());
  }

 private:
  [[nodiscard]] int dimension() const { return n_ * s_.nodes(); }

  void fill(std::span<const double> blocks, double damping) {
    const std::size_t entries = static_cast<std::size_t>(n_) * n_;
    for (int j = 0; j < s_.nodes(); ++j) {
      for (int c = 0; c < n_; ++c) {
        double* out = values_.data() + begin_[j * n_ + c];
        const double* diagonal = blocks.data() + entries * s_.system_begin[j] + n_ * c;
        const double first = diagonal[c] * (1 + damping);
        double* below = std::copy(diagonal + c, diagonal + n_, out);
        out[0] = first;
        for (int b = s_.system_begin[j] + 1; b < s_.system_begin[j + 1]; ++b) {
          below = std::copy_n(blocks.data() + entries * b + n_ * c, n_, below);
        }
      }
    }
  }

  const BlockStructure& s_;
  int n_;
  CholmodCommon common_;
  cholmod_factor* L_ = nullptr;
  std::vector<int> begin_, row_;
  std::vector<double> values_;
  cholmod_dense* X_ = nullptr;  // kept between solves
  cholmod_dense* Y_ = nullptr;
  cholmod_dense* E_ = nullptr;
};

}  // namespace

std::unique_ptr<BlockFactor> make_supernodal_factor(const BlockStructure& structure, int block_size) {
  return std::make_unique<SupernodalFactor>(structure, block_size);
}

}  // namespace twofold
