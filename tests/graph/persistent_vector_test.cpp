#include "graph/persistent_vector.hpp"

#include <gtest/gtest.h>

#include <cstdint>
#include <memory>
#include <random>
#include <tuple>
#include <vector>

namespace twofold {
namespace {

/// Counts how many values were copied or default constructed: what a version costs.
struct Counted {
  int value = 0;
  static inline long copies = 0;

  Counted() = default;
  explicit Counted(int v) : value(v) {}
  Counted(const Counted& other) : value(other.value) { ++copies; }
  Counted(Counted&&) noexcept = default;
  Counted& operator=(const Counted& other) {
    value = other.value;
    ++copies;
    return *this;
  }
  Counted& operator=(Counted&&) noexcept = default;
};

TEST(PersistentVector, AppendsAndReadsAcrossTreeHeights) {
  PersistentVector<int, 2> v;  // fan-out 4: five levels at 1000 entries
  for (int i = 0; i < 1000; ++i) {
    v.push_back(i * 3);
    ASSERT_EQ(v.size(), static_cast<std::size_t>(i + 1));
    ASSERT_EQ(v[static_cast<std::size_t>(i)], i * 3);
  }
  for (int i = 0; i < 1000; ++i) ASSERT_EQ(v[static_cast<std::size_t>(i)], i * 3);
}

TEST(PersistentVector, VersionsEqualReferenceVectorsUnderRandomWrites) {
  std::mt19937 rng(1);
  PersistentVector<int, 2> v;
  std::vector<int> truth;
  std::vector<std::pair<PersistentVector<int, 2>, std::vector<int>>> versions;
  for (int step = 0; step < 20000; ++step) {
    const unsigned action = rng() % 100;
    if (action < 40 || truth.empty()) {
      v.push_back(step);
      truth.push_back(step);
    } else if (action < 70) {
      const std::size_t i = rng() % truth.size();
      v.mutate(i) = -step;
      truth[i] = -step;
    } else if (action < 96) {
      const std::size_t i = rng() % truth.size();
      v.forget(i);
      truth[i] = 0;
    } else if (action < 98) {
      versions.emplace_back(v, truth);
    } else if (!versions.empty()) {  // versions die in any order; now and then the writer goes back to one
      const std::size_t k = rng() % versions.size();
      if (rng() % 4 == 0) std::tie(v, truth) = versions[k];
      versions.erase(versions.begin() + static_cast<std::ptrdiff_t>(k));
    }
    if (versions.size() > 20) versions.erase(versions.begin());
  }
  versions.emplace_back(v, truth);
  ASSERT_GT(versions.size(), 5U);
  for (const auto& [version, expected] : versions) {
    ASSERT_EQ(version.size(), expected.size());
    for (std::size_t i = 0; i < expected.size(); ++i) ASSERT_EQ(version[i], expected[i]) << "entry " << i;
  }
}

TEST(PersistentVector, CopyingCopiesNoValueAndWritingCopiesOneChunk) {
  PersistentVector<Counted> v;
  for (int i = 0; i < 40000; ++i) v.push_back(Counted(i));
  Counted::copies = 0;
  const PersistentVector<Counted> version = v;
  EXPECT_EQ(Counted::copies, 0);
  v.mutate(12345).value = -1;
  EXPECT_EQ(Counted::copies, static_cast<long>(PersistentVector<Counted>::kChunk));
  v.mutate(12346).value = -1;  // the chunk is the writer's own by now
  EXPECT_EQ(Counted::copies, static_cast<long>(PersistentVector<Counted>::kChunk));
  EXPECT_EQ(version[12345].value, 12345);
  EXPECT_EQ(v[12345].value, -1);
}

TEST(PersistentVector, VersionsShareUntouchedEntries) {
  PersistentVector<int> v;
  for (int i = 0; i < 5000; ++i) v.push_back(i);
  const PersistentVector<int> version = v;
  v.mutate(7) = 0;
  int shared = 0;
  for (std::size_t i = 0; i < v.size(); ++i) shared += &v[i] == &version[i] ? 1 : 0;
  EXPECT_EQ(shared, 5000 - static_cast<int>(PersistentVector<int>::kChunk));
}

TEST(PersistentVector, WritingWithoutOtherVersionsCopiesNothing) {
  PersistentVector<Counted> v;
  for (int i = 0; i < 3000; ++i) v.push_back(Counted(i));
  { const PersistentVector<Counted> gone = v; }
  Counted::copies = 0;
  for (std::size_t i = 0; i < v.size(); ++i) v.mutate(i).value = 1;
  EXPECT_EQ(Counted::copies, 0);
}

TEST(PersistentVector, AppendingLeavesOlderVersionsAtTheirSize) {
  PersistentVector<int, 2> v;
  for (int i = 0; i < 16; ++i) v.push_back(i);  // exactly full: the next push grows the tree
  const PersistentVector<int, 2> version = v;
  for (int i = 16; i < 80; ++i) v.push_back(i);
  EXPECT_EQ(version.size(), 16U);
  for (std::size_t i = 0; i < 16; ++i) EXPECT_EQ(version[i], static_cast<int>(i));
  for (std::size_t i = 0; i < 80; ++i) EXPECT_EQ(v[i], static_cast<int>(i));
}

TEST(PersistentVector, ForgottenEntriesReadAsDefaultsUntilWritten) {
  PersistentVector<int, 2> v;
  for (int i = 0; i < 70; ++i) v.push_back(i + 1);
  const PersistentVector<int, 2> version = v;
  v.forget(9);
  v.forget(69);
  v.forget(69);  // nothing to do
  for (std::size_t i = 0; i < 70; ++i) {
    EXPECT_EQ(v[i], i == 9 || i == 69 ? 0 : static_cast<int>(i) + 1);
    EXPECT_EQ(version[i], static_cast<int>(i) + 1);
  }
  v.mutate(9) = -1;
  v.push_back(-2);
  EXPECT_EQ(v[9], -1);
  EXPECT_EQ(v[69], 0);
  EXPECT_EQ(v[70], -2);
}

/// Knows how many of its kind there are. Aligned as the graph's entries, which have poses.
struct alignas(32) Living {
  Living() { ++count; }
  Living(const Living& other) : value(other.value) { ++count; }
  Living& operator=(const Living&) = default;
  ~Living() { --count; }
  static inline long count = 0;
  int value = 0;
};

TEST(PersistentVector, OnlyEntriesThatWereWrittenAndNotForgottenTakeMemory) {
  PersistentVector<Living, 2, 1> v;
  v.extend(1000);
  EXPECT_EQ(v.size(), 1000U);
  EXPECT_EQ(v[999].value, 0);
  const long none = Living::count;  // the one that all unwritten entries read as
  for (std::size_t i = 0; i < 1000; i += 7) v.mutate(i).value = static_cast<int>(i);
  EXPECT_EQ(Living::count, none + 143);
  for (std::size_t i = 0; i < 1000; ++i) ASSERT_EQ(v[i].value, i % 7 == 0 ? static_cast<int>(i) : 0);
  EXPECT_EQ(reinterpret_cast<std::uintptr_t>(&v[700]) % 32, 0U);
  v.extend(7);  // nothing to do
  EXPECT_EQ(v.size(), 1000U);
  for (std::size_t i = 0; i < 1000; i += 14) v.forget(i);
  EXPECT_EQ(Living::count, none + 71);
  for (std::size_t i = 0; i < 1000; ++i) ASSERT_EQ(v[i].value, i % 14 == 7 ? static_cast<int>(i) : 0);
  for (std::size_t i = 0; i < 1000; ++i) v.forget(i);
  EXPECT_EQ(Living::count, none);
  v.mutate(500).value = 5;
  v.push_back({});
  EXPECT_EQ(v[500].value, 5);
  EXPECT_EQ(v[501].value, 0);
  EXPECT_EQ(v.size(), 1001U);
}

TEST(PersistentVector, ValuesEndWithTheLastVersionThatHasThem) {
  const long none = Living::count;
  {
    PersistentVector<Living, 2> v;
    for (int i = 0; i < 100; ++i) v.push_back({});
    auto version = std::make_unique<PersistentVector<Living, 2>>(v);
    const long before = Living::count;
    for (std::size_t i = 0; i < 100; ++i) v.forget(i);
    EXPECT_EQ(Living::count, before);
    version.reset();
    EXPECT_LE(Living::count, before - 100);
  }
  EXPECT_LE(Living::count, none + 1);
}

TEST(PersistentVector, WritingBeyondTheEndIsABug) {
  PersistentVector<int> v;
  v.push_back(1);
  EXPECT_DEATH(static_cast<void>(v.mutate(1)), "beyond the vector's end");
}

}  // namespace
}  // namespace twofold
