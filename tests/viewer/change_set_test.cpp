#include "viewer/change_set.hpp"

#include <gtest/gtest.h>

#include <map>
#include <random>

namespace twofold {
namespace {

struct Number {
  std::uint32_t id = 0;
  int value = 0;
  [[nodiscard]] std::uint32_t key() const { return id; }
};
bool differs(const Number& shown, const Number& now) {
  return shown.value != now.value;
}

/// What somebody has who is told of changes.
struct Follower {
  std::map<std::uint32_t, int> numbers;
  Revision revision = 0;

  void follow(const ChangeSet<Number>& set, Revision now) {
    if (!set.knows(revision)) {
      numbers.clear();
      revision = 0;
    }
    for (const std::uint32_t gone : set.gone_since(revision)) numbers.erase(gone);
    for (const Number& number : set.changed_since(revision)) numbers[number.id] = number.value;
    revision = now;
  }
};

std::vector<Number> some_numbers(std::mt19937& rng, int most) {
  std::vector<Number> numbers;
  for (int id = 0; id < most; ++id) {
    if (rng() % 3 > 0) numbers.push_back({static_cast<std::uint32_t>(id), static_cast<int>(rng() % 4)});
  }
  return numbers;
}

TEST(ChangeSet, WhoeverFollowsHasTheSameHoweverSeldomHeLooks) {
  std::mt19937 rng(3);
  ChangeSet<Number> set;
  std::array<Follower, 4> followers;
  for (Revision revision = 1; revision <= 200; ++revision) {
    const std::vector<Number> numbers = some_numbers(rng, 40);
    set.replace(numbers, revision);
    std::map<std::uint32_t, int> expected;
    for (const Number& number : numbers) expected[number.id] = number.value;
    for (std::size_t f = 0; f < followers.size(); ++f) {
      if (rng() % (1 + 5 * f) > 0) continue;  // the later ones look seldom
      followers[f].follow(set, revision);
      ASSERT_EQ(followers[f].numbers, expected) << "follower " << f << ", revision " << revision;
    }
  }
}

TEST(ChangeSet, TellsNothingOfWhatStaysTheSame) {
  ChangeSet<Number> set;
  EXPECT_TRUE(set.replace({{1, 10}, {2, 20}}, 1));
  EXPECT_FALSE(set.replace({{1, 10}, {2, 20}}, 2));
  EXPECT_TRUE(set.changed_since(1).empty());
  EXPECT_TRUE(set.replace({{1, 10}, {2, 21}}, 3));
  ASSERT_EQ(set.changed_since(1).size(), 1U);
  EXPECT_EQ(set.changed_since(1)[0].id, 2U);
}

TEST(ChangeSet, WhoMissedTooMuchMustStartAfresh) {
  ChangeSet<Number> set;
  std::vector<Number> many(ChangeSet<Number>::kGoneKept + 1);
  for (std::size_t i = 0; i < many.size(); ++i) many[i].id = static_cast<std::uint32_t>(i);
  set.replace(many, 1);
  set.replace({many.begin(), many.end() - 1}, 2);
  EXPECT_TRUE(set.knows(1));
  set.replace({}, 3);  // one more is gone than is remembered
  EXPECT_FALSE(set.knows(1));
  EXPECT_TRUE(set.knows(2));
  EXPECT_TRUE(set.knows(0));
}

TEST(ChangeSet, WhatIsLeftOutIsGone) {
  ChangeSet<Number> set;
  for (std::uint32_t id = 0; id < 6; ++id) set.append({id, 0}, id + 1);
  set.drop(7, [](std::size_t i) { return i % 2 == 1; });
  EXPECT_EQ(set.gone_since(6), (std::vector<std::uint32_t>{1, 3, 5}));
  EXPECT_EQ(set.size(), 3U);
  EXPECT_EQ(set.find(3), nullptr);
  ASSERT_NE(set.find(4), nullptr);
}

}  // namespace
}  // namespace twofold
