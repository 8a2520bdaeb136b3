// One camera's start on rendered videos: some of those that bench/tracking/starts watches.
#include <gtest/gtest.h>

#include <algorithm>

#include "fixtures/starts.hpp"

namespace twofold {
namespace {

using testing::StartCase;

StartCase named(const std::vector<StartCase>& starts, const std::string& name) {
  return *std::find_if(starts.begin(), starts.end(), [&](const StartCase& s) { return s.name == name; });
}

class RightStart : public ::testing::TestWithParam<const char*> {};

TEST_P(RightStart, IsFoundWithinTwoSecondsOfMoving) {
  const auto outcome = testing::watch(named(testing::right_starts(), GetParam()), 2);
  ASSERT_TRUE(outcome.seconds) << outcome.waits_for;
  EXPECT_LT(outcome.direction_deg, 10);
  EXPECT_LT(outcome.turn_deg, 1);
}
INSTANTIATE_TEST_SUITE_P(Rendered, RightStart,
                         ::testing::Values("sideways, court", "turning, court", "forward, court",
                                           "forward, two walls", "desk, hand", "dark, forward"));

class WrongStart : public ::testing::TestWithParam<const char*> {};

TEST_P(WrongStart, IsNotAccepted) {
  const auto outcome = testing::watch(named(testing::wrong_starts(), GetParam()), 2);
  EXPECT_FALSE(outcome.seconds) << outcome.path << " m";
}
INSTANTIATE_TEST_SUITE_P(Rendered, WrongStart,
                         ::testing::Values("turning only, court", "panning, 25 ms, corridor",
                                           "standing, desk", "held still, court", "passer-by, near",
                                           "passer-by, turning", "60 % hidden", "80 % hidden",
                                           "80 % hidden, turning"));

}  // namespace
}  // namespace twofold
