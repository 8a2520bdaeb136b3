// Moravec's consistency check  (SWF 4.1.1).
#include "geometry/consistent_matches.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <random>

#include "geometry/agreement_graph.hpp"
#include "geometry/se3.hpp"

namespace twofold {
namespace {

struct Body {
  std::vector<PointMatch3d> matches;
  std::vector<int> rigid;  ///< indices that follow the motion
};

/// `rigid` matches move together, the others each on its own; in random order.
Body make_body(int rigid, int loose, double noise, unsigned seed) {
  std::mt19937 random(seed);
  std::normal_distribution<double> n(0, 1);
  std::uniform_real_distribution<double> x(-2, 2), z(2, 8);
  const SE3 T_1_0(SO3::exp(Vector3(0.2, -0.3, 0.1)), Vector3(0.4, 0.1, -0.3));
  const auto point = [&] { return Vector3(x(random), x(random), z(random)); };
  Body body;
  std::vector<bool> moves(static_cast<std::size_t>(rigid + loose));
  std::fill_n(moves.begin(), rigid, true);
  std::shuffle(moves.begin(), moves.end(), random);
  for (std::size_t i = 0; i < moves.size(); ++i) {
    PointMatch3d m;
    m.x_0 = point();
    m.x_1 = moves[i] ? Vector3(T_1_0 * m.x_0) : point();
    m.x_1 += noise * Vector3(n(random), n(random), n(random));
    m.covariance_1 = noise * noise * Matrix3::Identity();
    body.matches.push_back(m);
    if (moves[i]) body.rigid.push_back(static_cast<int>(i));
  }
  return body;
}

TEST(ConsistentMatches, FindsTheRigidPartBelowOneHalf) {
  for (unsigned seed = 1; seed <= 20; ++seed) {
    const Body body = make_body(30, 50, 0, seed);
    EXPECT_EQ(consistent_matches(body.matches, {.threshold = 0.01, .sigmas = 3}), body.rigid) << seed;
  }
}

TEST(ConsistentMatches, AnswerIsAMaximalClique) {
  const ConsistencyOptions options{.threshold = 0.05, .sigmas = 0};
  const Body body = make_body(25, 60, 0.01, 4);
  const std::vector<int> clique = consistent_matches(body.matches, options);
  const auto agree = [&](int a, int b) {
    const auto &p = body.matches[static_cast<std::size_t>(a)], &q = body.matches[static_cast<std::size_t>(b)];
    return std::abs((p.x_0 - q.x_0).norm() - (p.x_1 - q.x_1).norm()) <= options.threshold;
  };
  for (const int a : clique) {
    for (const int b : clique) EXPECT_TRUE(agree(a, b));
  }
  for (int i = 0; i < static_cast<int>(body.matches.size()); ++i) {
    if (std::find(clique.begin(), clique.end(), i) != clique.end()) continue;
    EXPECT_FALSE(std::all_of(clique.begin(), clique.end(), [&](int c) { return agree(i, c); })) << i;
  }
}

/// Stereo points far away are uncertain along the ray: with their covariances most rigid ones are kept, with
/// the bare threshold few.
TEST(ConsistentMatches, UncertaintyWidensTheThreshold) {
  Body body = make_body(40, 30, 0.08, 7);
  const auto share = [&](double sigmas) {
    const auto clique = consistent_matches(body.matches, {.threshold = 0.01, .sigmas = sigmas});
    int kept = 0;
    for (const int i : clique) kept += std::binary_search(body.rigid.begin(), body.rigid.end(), i);
    EXPECT_LE(static_cast<int>(clique.size()) - kept, 3);
    return kept / 40.0;
  };
  EXPECT_LT(share(0), 0.4);
  EXPECT_GT(share(3), 0.8);
}

TEST(ConsistentMatches, FewMatches) {
  EXPECT_TRUE(consistent_matches({}, {}).empty());
  const Body body = make_body(1, 0, 0, 1);
  EXPECT_EQ(consistent_matches(body.matches, {}), std::vector<int>{0});
}

/// Against all triples tried one by one, over the border of a word of bits.
TEST(AgreementGraph, KnowsAllTriplesThatAgree) {
  constexpr std::size_t kN = 130;
  std::mt19937 random(3);
  AgreementGraph graph(kN);
  for (std::size_t a = 0; a < kN; ++a) {
    for (std::size_t b = a + 1; b < kN; ++b) {
      if (random() % 5 == 0) graph.join(a, b);
    }
  }
  std::vector<std::array<int, 3>> all;
  for (std::size_t a = 0; a < kN; ++a) {
    for (std::size_t b = a + 1; b < kN; ++b) {
      for (std::size_t c = b + 1; c < kN; ++c) {
        if (graph.agree(a, b) && graph.agree(a, c) && graph.agree(b, c))
          all.push_back({static_cast<int>(a), static_cast<int>(b), static_cast<int>(c)});
      }
    }
  }
  ASSERT_GT(all.size(), 1000U);
  EXPECT_EQ(graph.triples(all.size()), all);
  const auto some = graph.triples(100);
  EXPECT_LE(some.size(), 100U);
  EXPECT_GT(some.size(), 90U);
  EXPECT_TRUE(std::includes(all.begin(), all.end(), some.begin(), some.end()));
  EXPECT_TRUE(AgreementGraph(2).triples(5).empty());
}

}  // namespace
}  // namespace twofold
