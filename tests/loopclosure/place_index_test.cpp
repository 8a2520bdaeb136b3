#include "loopclosure/place_index.hpp"

#include <gtest/gtest.h>
#include <malloc.h>

#include "tests/sanitized.hpp"

namespace twofold {
namespace {

constexpr std::size_t kWords = 50;

/// Half of the weight on word k, half on its successor.
BagOfWords bag(std::uint32_t k) {
  const std::uint32_t word = k % (kWords - 1);
  return {{word, 0.5F}, {word + 1, 0.5F}};
}

bool any(KeyframeId /*id*/) {
  return true;
}

TEST(PlaceIndex, AnswersTheLikestFirstAndTiesByAge) {
  PlaceIndex index(kWords);
  for (const std::uint32_t k : {7U, 3U, 4U, 5U}) index.add(KeyframeId{k}, bag(k));
  index.add(KeyframeId{1}, bag(4));
  const auto found = index.query(bag(4), 4, any);
  ASSERT_EQ(found.size(), 4U);
  EXPECT_EQ(found[0].keyframe, KeyframeId{1});
  EXPECT_EQ(found[1].keyframe, KeyframeId{4});
  EXPECT_EQ(found[2].keyframe, KeyframeId{3});
  EXPECT_EQ(found[3].keyframe, KeyframeId{5});
  EXPECT_NEAR(found[0].score, 1, 1e-6);
  EXPECT_NEAR(found[2].score, 0.5, 1e-6);
}

TEST(PlaceIndex, WhoIsNotAdmittedTakesNobodysTurn) {
  PlaceIndex index(kWords);
  for (std::uint32_t k = 0; k < 20; ++k) index.add(KeyframeId{k}, bag(4));
  const auto found = index.query(bag(4), 2, [](KeyframeId id) { return twofold::index(id) >= 15; });
  ASSERT_EQ(found.size(), 2U);
  EXPECT_EQ(found[0].keyframe, KeyframeId{15});
  EXPECT_EQ(found[1].keyframe, KeyframeId{16});
}

TEST(PlaceIndex, ForgetsWithinOneTurn) {
  PlaceIndex index(kWords);
  for (std::uint32_t k = 0; k < 20; ++k) index.add(KeyframeId{k}, bag(k));
  const auto odd = [](KeyframeId id) { return twofold::index(id) % 2 == 1; };
  std::size_t forgotten = 0;
  for (int call = 0; call < 4; ++call) forgotten += index.forget(5, odd).size();
  EXPECT_EQ(forgotten, 10U);
  EXPECT_EQ(index.keyframe_count(), 10U);
  for (std::uint32_t k = 0; k < 20; ++k) {
    for (const PlaceCandidate& candidate : index.query(bag(k), 20, any))
      EXPECT_FALSE(odd(candidate.keyframe));
  }
}

/// Keyframe ids grow for as long as the camera moves.
TEST(PlaceIndex, MemoryFollowsWhatIsInItNotTheIds) {
  if (testing::kSanitized) GTEST_SKIP() << "the sanitizer's allocator keeps no such count";
  constexpr std::uint32_t kAlive = 100;
  PlaceIndex index(kWords);
  const auto browse = [&](std::uint32_t from, std::uint32_t to) {
    for (std::uint32_t k = from; k < to; ++k) {
      index.add(KeyframeId{k}, bag(k));
      (void)index.forget(64, [&](KeyframeId id) { return twofold::index(id) + kAlive <= k; });
      (void)index.query(bag(k), 5, any);
      ASSERT_LE(index.keyframe_count(), kAlive + 5);
    }
  };
  browse(0, 10'000);
  const std::size_t before = mallinfo2().uordblks;
  browse(10'000, 210'000);
  EXPECT_LT(mallinfo2().uordblks, before + 10'000);
}

}  // namespace
}  // namespace twofold
