#include "geometry/agreement_graph.hpp"

#include <bit>

#include "base/check.hpp"

namespace twofold {
namespace {

/// Of two rows' common bits those after b, in word w.
std::uint64_t common_after(std::size_t b, std::size_t w, std::span<const std::uint64_t> row_a,
                           std::span<const std::uint64_t> row_b) {
  const std::uint64_t common = row_a[w] & row_b[w];
  return w == b / 64 ? common & ~(AgreementGraph::bit(b) | (AgreementGraph::bit(b) - 1)) : common;
}

std::size_t count_after(std::size_t b, std::span<const std::uint64_t> row_a,
                        std::span<const std::uint64_t> row_b) {
  std::size_t count = 0;
  for (std::size_t w = b / 64; w < row_a.size(); ++w) {
    count += static_cast<std::size_t>(std::popcount(common_after(b, w, row_a, row_b)));
  }
  return count;
}

}  // namespace

template <class Visit>
void AgreementGraph::for_each_pair(const Visit& visit) const {
  for (std::size_t a = 0; a < n_; ++a) {
    for (std::size_t b = a + 1; b < n_; ++b) {
      if (agree(a, b)) visit(a, b);
    }
  }
}

std::vector<std::array<int, 3>> AgreementGraph::triples(std::size_t most) const {
  TWOFOLD_CHECK(most > 0, "at least one triple");
  std::size_t count = 0;
  for_each_pair([&](std::size_t a, std::size_t b) { count += count_after(b, row(a), row(b)); });
  const std::size_t step = (count + most - 1) / most;
  std::vector<std::array<int, 3>> result;
  std::size_t passed = 0, next = 0;  // triples
  for_each_pair([&](std::size_t a, std::size_t b) {
    const std::size_t end = passed + count_after(b, row(a), row(b));
    for (std::size_t w = b / 64; w < words_ && next < end; ++w) {
      for (std::uint64_t left = common_after(b, w, row(a), row(b)); left != 0; left &= left - 1) {
        if (passed++ != next) continue;
        next += step;
        const std::size_t c = 64 * w + static_cast<std::size_t>(std::countr_zero(left));
        result.push_back({static_cast<int>(a), static_cast<int>(b), static_cast<int>(c)});
      }
    }
    passed = end;
  });
  return result;
}

}  // namespace twofold
