#include "sparse/block_structure.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "base/check.hpp"
#include "sparse/cholmod_common.hpp"

namespace twofold {
namespace {

/// Lower triangle of an undirected graph with its diagonal: sorted columns without repetitions.
struct Pattern {
  std::vector<int> begin, row;
};

/// Two passes of counting sort, by row and then by column.
Pattern lower_triangle(int nodes, std::span<const std::pair<int, int>> edges) {
  std::vector<int> row_count(nodes + 1, 0);
  for (const auto& [i, j] : edges) ++row_count[std::max(i, j) + 1];
  std::partial_sum(row_count.begin(), row_count.end(), row_count.begin());
  std::vector<int> columns(edges.size());
  std::vector<int> next(row_count.begin(), row_count.end() - 1);
  for (const auto& [i, j] : edges) columns[next[std::max(i, j)]++] = std::min(i, j);

  Pattern pattern;
  pattern.begin.assign(nodes + 1, 0);
  std::vector<int> last_row(nodes, -1);
  const auto for_each_entry = [&](auto&& visit) {
    std::fill(last_row.begin(), last_row.end(), -1);
    for (int row = 0; row < nodes; ++row) {
      visit(row, row);
      for (int e = row_count[row]; e < row_count[row + 1]; ++e) {
        if (std::exchange(last_row[columns[e]], row) != row) visit(row, columns[e]);
      }
    }
  };
  for_each_entry([&](int, int column) { ++pattern.begin[column + 1]; });
  std::partial_sum(pattern.begin.begin(), pattern.begin.end(), pattern.begin.begin());
  pattern.row.resize(pattern.begin[nodes]);
  next.assign(pattern.begin.begin(), pattern.begin.end() - 1);
  for_each_entry([&](int row, int column) { pattern.row[next[column]++] = row; });
  return pattern;
}

/// Replaces the order by nested dissection's where that takes fewer flops than `flops`.
void try_dissection(cholmod_sparse& A, double flops, std::vector<int>& order) {
  CholmodCommon common;
  common.c.nmethods = 1;
  common.c.method[0].ordering = CHOLMOD_METIS;
  common.c.supernodal = CHOLMOD_SIMPLICIAL;  // symbolic work on single nodes only
  cholmod_factor* L = cholmod_analyze(&A, &common.c);
  if (L != nullptr && common.c.fl < flops) {
    std::copy_n(static_cast<const int*>(L->Perm), order.size(), order.begin());
  }
  cholmod_free_factor(&L, &common.c);
}

std::vector<int> choose_order(int nodes, std::span<const std::pair<int, int>> edges, int block_size) {
  // Nested dissection takes some twenty times as long as minimum degree and saves a tenth to a fifth of the
  // flops of sphere2500 and torus3D (docs/results/solvers.md): it pays where a factorisation has more of them
  // than these.
  constexpr double kWorthDissecting = 2e9;
  std::vector<int> order(nodes);
  if (nodes == 0) return order;
  Pattern pattern = lower_triangle(nodes, edges);
  cholmod_sparse A = lower_triangle_view(nodes, pattern.begin, pattern.row);
  CholmodCommon common;
  const bool ordered = cholmod_amd(&A, nullptr, 0, order.data(), &common.c) != 0;
  TWOFOLD_CHECK(ordered, "ordering runs out of memory only");
  if (common.c.fl * std::pow(block_size, 3) > kWorthDissecting) try_dissection(A, common.c.fl, order);
  return order;
}

/// Rows of the factor along the elimination tree: row k has the columns on the paths from those of the
/// system's row k up to k  (Davis, Direct Methods for Sparse Linear Systems, 4.2).
void find_fill(BlockStructure& s) {
  const int n = s.nodes();
  std::vector<int> count(n, 0), parent(n, -1), met(n, -1);
  // Rows of the system, from its columns.
  std::vector<int> begin(n + 1, 0);
  for (const int row : s.system_row) ++begin[row + 1];
  std::partial_sum(begin.begin(), begin.end(), begin.begin());
  std::vector<int> column(s.system_row.size());
  std::vector<int> next(begin.begin(), begin.end() - 1);
  for (int j = 0; j < n; ++j) {
    for (int b = s.system_begin[j]; b < s.system_begin[j + 1]; ++b) column[next[s.system_row[b]]++] = j;
  }
  s.row_begin.assign(1, 0);
  s.row_entries.clear();
  for (int k = 0; k < n; ++k) {
    met[k] = k;
    for (int e = begin[k]; e < begin[k + 1]; ++e) {
      for (int j = column[e]; met[j] != k; j = parent[j]) {
        if (parent[j] < 0) parent[j] = k;
        met[j] = k;
        ++count[j];
        s.row_entries.push_back({j, 0});
      }
    }
    s.row_begin.push_back(static_cast<int>(s.row_entries.size()));
  }
  s.factor_begin.assign(n + 1, 0);
  for (int j = 0; j < n; ++j) {
    s.factor_begin[j + 1] = s.factor_begin[j] + count[j] + 1;
    s.block_products += 0.5 * count[j] * (count[j] + 1.0);
  }
  s.factor_row.resize(s.factor_begin[n]);
  next.assign(s.factor_begin.begin(), s.factor_begin.end() - 1);
  for (int k = 0; k < n; ++k) {
    for (int e = s.row_begin[k]; e < s.row_begin[k + 1]; ++e) {
      auto& entry = s.row_entries[e];
      entry.block = next[entry.column]++;
      s.factor_row[entry.block] = k;
    }
    s.factor_row[next[k]++] = k;
  }
}

void place_system_in_factor(BlockStructure& s) {
  s.factor_block.resize(s.system_row.size());
  for (int j = 0; j < s.nodes(); ++j) {
    int place = s.factor_begin[j];
    for (int b = s.system_begin[j]; b < s.system_begin[j + 1]; ++b) {
      while (s.factor_row[place] != s.system_row[b]) ++place;
      s.factor_block[b] = place;
    }
  }
}

}  // namespace

double BlockStructure::flops(int block_size) const {
  return 2 * block_products * std::pow(block_size, 3);
}

BlockStructure analyse_blocks(int nodes, std::span<const std::pair<int, int>> edges, int block_size) {
  for (const auto& [i, j] : edges) {
    TWOFOLD_CHECK(i != j && i >= 0 && j >= 0 && i < nodes && j < nodes, "edge joins two different nodes");
  }
  BlockStructure s;
  s.order = choose_order(nodes, edges, block_size);
  s.position.resize(nodes);
  for (int k = 0; k < nodes; ++k) s.position[s.order[k]] = k;
  std::vector<std::pair<int, int>> ordered;
  ordered.reserve(edges.size());
  for (const auto& [i, j] : edges) ordered.emplace_back(s.position[i], s.position[j]);
  Pattern pattern = lower_triangle(nodes, ordered);
  s.system_begin = std::move(pattern.begin);
  s.system_row = std::move(pattern.row);
  s.slots.reserve(edges.size());
  for (const auto& [i, j] : ordered) {
    const auto [column, row] = std::minmax(i, j);
    const auto first = s.system_row.begin() + s.system_begin[column];
    const auto found = std::lower_bound(first, s.system_row.begin() + s.system_begin[column + 1], row);
    s.slots.push_back({static_cast<int>(found - s.system_row.begin()), i < j});
  }
  find_fill(s);
  place_system_in_factor(s);
  return s;
}

}  // namespace twofold
