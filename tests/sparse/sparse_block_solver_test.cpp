#include "sparse/sparse_block_solver.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <random>

#include "geometry/types.hpp"
#include "sparse/panel_structure.hpp"

namespace twofold {
namespace {

using Edges = std::vector<std::pair<int, int>>;

/// Chain with chords, the same every time; some edges twice.
Edges chain_with_chords(int nodes, int chords) {
  Edges edges;
  std::mt19937 rng(3);
  for (int i = 0; i + 1 < nodes; ++i) edges.emplace_back(i, i + 1);
  for (int n = 0; n < chords; ++n) {
    const int i = static_cast<int>(rng() % nodes), j = static_cast<int>(rng() % nodes);
    if (i != j) edges.emplace_back(i, j);
  }
  if (nodes > 1) edges.emplace_back(1, 0);
  return edges;
}

/// Solver and dense matrix with the same random blocks, strictly diagonally dominant.
template <int N>
struct System {
  System(int nodes, int chords) : edges(chain_with_chords(nodes, chords)) {
    structure = analyse_blocks(nodes, edges, N);
    solver.set_structure(structure, N);
    A.setZero(N * nodes, N * nodes);
    for (std::size_t e = 0; e < edges.size(); ++e) {
      const auto [i, j] = edges[e];
      const Block block = Block::NullaryExpr([&] { return normal(rng); });
      solver.add_off_diagonal<N>(e, block);
      A.block<N, N>(N * i, N * j) += block;
      A.block<N, N>(N * j, N * i) += block.transpose();
    }
    for (int i = 0; i < nodes; ++i) {
      const Block block = Block::Identity() * (1 + A.middleRows<N>(N * i).cwiseAbs().sum());
      solver.add_diagonal<N>(i, block);
      A.block<N, N>(N * i, N * i) += block;
    }
  }
  [[nodiscard]] Eigen::MatrixXd random(int columns) {
    return Eigen::MatrixXd::NullaryExpr(A.rows(), columns, [&] { return normal(rng); });
  }

  using Block = Eigen::Matrix<double, N, N>;
  std::mt19937 rng{6};
  std::normal_distribution<double> normal;
  Edges edges;
  BlockStructure structure;
  SparseBlockSolver solver;
  Eigen::MatrixXd A;
};

template <class Size>
class SparseBlockSolverTest : public testing::Test {};
template <int N>
using Size = std::integral_constant<int, N>;
using Sizes = testing::Types<Size<1>, Size<2>, Size<3>, Size<6>, Size<7>>;
TYPED_TEST_SUITE(SparseBlockSolverTest, Sizes);

TYPED_TEST(SparseBlockSolverTest, SolvesAsTheDenseMatrixDoes) {
  for (const int nodes : {1, 2, 60}) {
    System<TypeParam::value> system(nodes, nodes / 2);
    const Eigen::MatrixXd b = system.random(2);
    ASSERT_TRUE(system.solver.factorise(0));
    EXPECT_LT((system.A * system.solver.solve(b) - b).norm(), 1e-11);
    ASSERT_TRUE(system.solver.factorise(0.5));  // the system itself stayed
    system.A.diagonal() *= 1.5;
    EXPECT_LT((system.A * system.solver.solve(b) - b).norm(), 1e-11);
  }
}

TYPED_TEST(SparseBlockSolverTest, RefusesAnIndefiniteMatrix) {
  constexpr int kSize = TypeParam::value;
  System<kSize> system(30, 10);
  using Block = typename System<kSize>::Block;
  system.solver.template add_diagonal<kSize>(4, Block(-1e4 * Block::Identity()));
  EXPECT_FALSE(system.solver.factorise(0));
}

TYPED_TEST(SparseBlockSolverTest, BothKindsOfFactorAgree) {
  constexpr int kNodes = 120, kSize = TypeParam::value;
  System<kSize> system(kNodes, 150);
  std::vector<double> blocks(system.structure.system_row.size() * kSize * kSize);
  for (int j = 0; j < kNodes; ++j) {
    for (int b = system.structure.system_begin[j]; b < system.structure.system_begin[j + 1]; ++b) {
      const int row = system.structure.order[system.structure.system_row[b]];
      const int column = system.structure.order[j];
      Eigen::Map<typename System<kSize>::Block>(blocks.data() + b * kSize * kSize) =
          system.A.template block<kSize, kSize>(kSize * row, kSize * column);
    }
  }
  const auto simplicial = make_simplicial_factor(system.structure, kSize);
  const auto supernodal = make_supernodal_factor(system.structure, kSize);
  for (const double damping : {0.0, 0.1}) {
    Eigen::MatrixXd x = system.random(3), y = x;
    ASSERT_TRUE(simplicial->factorise(blocks, damping));
    ASSERT_TRUE(supernodal->factorise(blocks, damping));
    simplicial->solve(x);
    supernodal->solve(y);
    EXPECT_LT((x - y).norm(), 1e-12 * y.norm());
  }
  blocks[0] = -1;
  EXPECT_FALSE(simplicial->factorise(blocks, 0));
  EXPECT_FALSE(supernodal->factorise(blocks, 0));
}

/// In minimum degree's order, and in nested dissection's, which a huge block size makes worth its time.
class BlockStructureTest : public testing::TestWithParam<int> {};
INSTANTIATE_TEST_SUITE_P(BlockSizes, BlockStructureTest, testing::Values(1, 10000));

TEST_P(BlockStructureTest, FactorHoldsSystemAndFill) {
  const Edges edges = chain_with_chords(40, 30);
  const BlockStructure s = analyse_blocks(40, edges, GetParam());
  // Boolean elimination on the dense pattern.
  Eigen::MatrixXi dense = Eigen::MatrixXi::Identity(40, 40);
  for (const auto& [i, j] : edges)
    dense(s.position[i], s.position[j]) = dense(s.position[j], s.position[i]) = 1;
  for (int k = 0; k < 40; ++k) {
    for (int i = k + 1; i < 40; ++i) {
      for (int j = k + 1; j < 40; ++j) dense(i, j) |= dense(i, k) & dense(k, j);
    }
  }
  for (int j = 0; j < 40; ++j) {
    std::vector<int> rows;
    for (int i = j; i < 40; ++i) {
      if (dense(i, j) != 0) rows.push_back(i);
    }
    EXPECT_EQ(rows, std::vector<int>(s.factor_row.begin() + s.factor_begin[j],
                                     s.factor_row.begin() + s.factor_begin[j + 1]));
  }
}

TEST_P(BlockStructureTest, PanelsHoldTheFactor) {
  for (const int nodes : {0, 1, 2, 60}) {
    const BlockStructure s = analyse_blocks(nodes, chain_with_chords(nodes, nodes), GetParam());
    const PanelStructure p = gather_panels(s);
    int column = 0;
    double trapezoids = 0;
    for (const auto& panel : p.panels) {
      trapezoids += panel.width * (panel.height() - 0.5 * (panel.width - 1));
      EXPECT_EQ(panel.first, column);
      const auto begin = p.row.begin() + panel.begin, end = p.row.begin() + panel.end;
      EXPECT_TRUE(std::is_sorted(begin, end));
      for (; column < panel.first + panel.width; ++column) {
        EXPECT_EQ(p.row[panel.begin + column - panel.first], column);
        EXPECT_TRUE(std::includes(begin, end, s.factor_row.begin() + s.factor_begin[column],
                                  s.factor_row.begin() + s.factor_begin[column + 1]));
      }
    }
    EXPECT_EQ(column, nodes);
    EXPECT_LE(trapezoids, 1.25 * s.factor_row.size());  // at most a fifth is zeros
    EXPECT_LE(p.panels.size(), 1 + 0.9 * nodes);
  }
}

}  // namespace
}  // namespace twofold
