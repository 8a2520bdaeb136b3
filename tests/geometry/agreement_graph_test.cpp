#include "geometry/agreement_graph.hpp"

#include <gtest/gtest.h>

#include <array>
#include <vector>

#include "geometry/ransac.hpp"

namespace twofold {
namespace {

using Triples = std::vector<std::array<int, 3>>;

AgreementGraph random_graph(int n, std::uint64_t seed) {
  SplitMix64 random(seed);
  AgreementGraph graph(static_cast<std::size_t>(n));
  for (int a = 0; a < n; ++a) {
    for (int b = a + 1; b < n; ++b) {
      if (random.below(4) == 0) graph.join(static_cast<std::size_t>(a), static_cast<std::size_t>(b));
    }
  }
  return graph;
}

Triples one_by_one(const AgreementGraph& graph, int n) {
  const auto agree = [&](int a, int b) {
    return graph.agree(static_cast<std::size_t>(a), static_cast<std::size_t>(b));
  };
  Triples triples;
  for (int a = 0; a < n; ++a) {
    for (int b = a + 1; b < n; ++b) {
      for (int c = b + 1; c < n; ++c) {
        if (agree(a, b) && agree(a, c) && agree(b, c)) triples.push_back({a, b, c});
      }
    }
  }
  return triples;
}

TEST(AgreementGraph, ItsTriplesAreThoseAnyTwoOfWhichAgree) {
  for (const int n : {0, 2, 3, 63, 64, 65, 130}) {
    const AgreementGraph graph = random_graph(n, static_cast<std::uint64_t>(n));
    EXPECT_EQ(graph.triples(1'000'000), one_by_one(graph, n)) << n;
  }
}

TEST(AgreementGraph, OfMoreThanAreWantedItTakesEvenlyMany) {
  const AgreementGraph graph = random_graph(130, 1);
  const Triples all = one_by_one(graph, 130);
  for (const std::size_t most : {std::size_t{1}, std::size_t{300}, all.size() - 1, all.size()}) {
    const std::size_t step = (all.size() + most - 1) / most;
    Triples expected;
    for (std::size_t t = 0; t < all.size(); t += step) expected.push_back(all[t]);
    EXPECT_LE(expected.size(), most);
    EXPECT_EQ(graph.triples(most), expected) << most;
  }
}

}  // namespace
}  // namespace twofold
