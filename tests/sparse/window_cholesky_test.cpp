#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <random>

#include "sparse/block_cholesky.hpp"
#include "sparse/block_kernels.hpp"

namespace twofold {
namespace {

template <class Matrix>
Matrix random_matrix(std::mt19937& rng) {
  std::normal_distribution<double> normal;
  Matrix m;
  for (auto& value : m.reshaped()) value = normal(rng);
  return m;
}

TEST(BlockKernels, AddOuterProduct) {
  std::mt19937 rng(1);
  for (int n = 0; n < 20; ++n) {
    const auto A = random_matrix<Matrix6>(rng), B = random_matrix<Matrix6>(rng),
               C = random_matrix<Matrix6>(rng);
    Matrix6 result = A;
    add_outer_product<-1, 6>(result.data(), B.data(), C.data());
    EXPECT_LT((result - (A - B * C.transpose())).norm(), 1e-13);
    result = A;
    add_outer_product<1, 3>(result.data(), B.data(), C.data());
    EXPECT_LT((result - (A + B.leftCols<3>() * C.leftCols<3>().transpose())).norm(), 1e-13);
  }
}

std::vector<int> after(const CouplingPattern& pattern, int i) {
  std::vector<int> result;
  pattern.for_each_after(i, [&](int j) { result.push_back(j); });
  return result;
}

TEST(CouplingPattern, ListsWhatComesAfterInOrderAcrossWords) {
  CouplingPattern pattern(200);
  for (const int j : {199, 3, 64, 63, 128, 64}) pattern.couple(j, 5);  // 3 comes before 5
  EXPECT_EQ(after(pattern, 5), (std::vector{63, 64, 128, 199}));
  EXPECT_EQ(after(pattern, 3), (std::vector{5}));
  EXPECT_TRUE(after(pattern, 199).empty());
}

TEST(CouplingPattern, InheritsOnlyWhatComesAfterTheNodeItself) {
  CouplingPattern pattern(200);
  for (const int j : {20, 63, 64, 65, 130}) pattern.couple(5, j);
  pattern.couple(64, 199);
  pattern.inherit(64, 5);
  EXPECT_EQ(after(pattern, 64), (std::vector{65, 130, 199}));
  EXPECT_EQ(after(pattern, 5), (std::vector{20, 63, 64, 65, 130}));
}

struct Pattern {
  const char* name;
  int size;
  double density;
  bool chain;
};

class BlockCholeskyTest : public testing::TestWithParam<Pattern> {
 protected:
  /// Random positive definite matrix with the pattern, put into `cholesky` and returned dense, in the order
  /// of the unknowns.
  Eigen::MatrixXd fill(BlockCholesky& cholesky, std::mt19937& rng) {
    const auto [name, n, density, chain] = GetParam();
    std::uniform_real_distribution<double> uniform;
    std::vector<std::vector<int>> neighbours(n);
    CouplingPattern pattern(n);
    for (int i = 0; i < n; ++i) {
      for (int j = i + 1; j < n; ++j) {
        if (!((chain && j == i + 1) || uniform(rng) < density)) continue;
        neighbours[i].push_back(j);
        pattern.couple(i, j);
      }
    }
    cholesky.set_pattern(pattern);
    cholesky.set_zero();
    Eigen::MatrixXd dense = Eigen::MatrixXd::Zero(6 * n, 6 * n);
    for (int i = 0; i < n; ++i) {
      for (const int j : neighbours[i]) {
        const Matrix6 B = random_matrix<Matrix6>(rng);
        dense.block<6, 6>(6 * i, 6 * j) = B;
        dense.block<6, 6>(6 * j, 6 * i) = B.transpose();
      }
    }
    for (int i = 0; i < n; ++i) {
      dense.block<6, 6>(6 * i, 6 * i).setIdentity();
      dense.block<6, 6>(6 * i, 6 * i) *= 1 + dense.middleRows<6>(6 * i).cwiseAbs().sum();
    }
    for (int i = 0; i < n; ++i) {
      const int p = cholesky.position()[i];
      cholesky.block(cholesky.diagonal_index(p)) = dense.block<6, 6>(6 * i, 6 * i);
      for (const int j : neighbours[i]) {
        const int q = cholesky.position()[j];
        cholesky.block(cholesky.block_index(std::max(p, q), std::min(p, q))) =
            p > q ? Matrix6(dense.block<6, 6>(6 * i, 6 * j)) : Matrix6(dense.block<6, 6>(6 * j, 6 * i));
      }
    }
    return dense;
  }
};

TEST_P(BlockCholeskyTest, SolvesAsTheDenseFactorisationDoes) {
  std::mt19937 rng(3);
  BlockCholesky cholesky;
  for (int repeat = 0; repeat < 2; ++repeat) {  // the second pattern replaces the first
    const Eigen::MatrixXd dense = fill(cholesky, rng);
    const int n = GetParam().size;
    Eigen::VectorXd b(6 * n);
    std::vector<Vector6> x(n);
    for (int i = 0; i < n; ++i) {
      b.segment<6>(6 * i) = random_matrix<Vector6>(rng);
      x[cholesky.position()[i]] = b.segment<6>(6 * i);
    }
    ASSERT_TRUE(cholesky.factorise());
    cholesky.solve(x);
    const Eigen::VectorXd expected = dense.llt().solve(b);
    for (int i = 0; i < n; ++i) {
      EXPECT_LT((x[cholesky.position()[i]] - expected.segment<6>(6 * i)).norm(), 1e-12);
    }
  }
}

TEST_P(BlockCholeskyTest, FindsTheBlocksOfAColumn) {
  std::mt19937 rng(5);
  BlockCholesky cholesky;
  fill(cholesky, rng);
  const int n = GetParam().size;
  for (int round = 0; round < 2; ++round) {  // places left by other columns do not count
    for (int column = 0; column < n; ++column) {
      std::vector<int> rows, blocks(n - column);
      for (int row = column; row < n; ++row) rows.push_back(row);
      cholesky.block_indices(column, rows, blocks);
      int expected = cholesky.diagonal_index(column);
      for (int row = column; row < n; ++row) {
        if (blocks[row - column] < 0) continue;
        EXPECT_EQ(blocks[row - column], expected++);
        EXPECT_EQ(blocks[row - column], cholesky.block_index(row, column));
      }
      if (column + 1 < n) {
        EXPECT_EQ(expected, cholesky.diagonal_index(column + 1));
      }
    }
  }
}

TEST_P(BlockCholeskyTest, RefusesIndefiniteMatrices) {
  std::mt19937 rng(4);
  BlockCholesky cholesky;
  fill(cholesky, rng);
  cholesky.block(cholesky.diagonal_index(GetParam().size / 2))(3, 3) = -1;
  EXPECT_FALSE(cholesky.factorise());
}

INSTANTIATE_TEST_SUITE_P(Patterns, BlockCholeskyTest,
                         testing::Values(Pattern{"One", 1, 0, false}, Pattern{"Diagonal", 7, 0, false},
                                         Pattern{"Chain", 30, 0, true}, Pattern{"Sparse", 60, 0.05, true},
                                         Pattern{"Half", 20, 0.5, false}, Pattern{"Dense", 25, 1, false}),
                         [](const auto& test) { return test.param.name; });

}  // namespace
}  // namespace twofold
