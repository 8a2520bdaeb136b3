#include "camera/usual_interval.hpp"

#include <gtest/gtest.h>

namespace twofold {
namespace {

constexpr std::int64_t kMs = 1'000'000;

TEST(UsualInterval, IsNoneBeforeTheSecondFrame) {
  UsualInterval interval;
  EXPECT_EQ(interval.ns(), 0);
  interval.add(7 * kMs);
  EXPECT_EQ(interval.ns(), 0);
  interval.add(7 * kMs);  // the same frame again
  EXPECT_EQ(interval.ns(), 0);
  interval.add(40 * kMs);
  EXPECT_EQ(interval.ns(), 33 * kMs);
}

TEST(UsualInterval, NeitherPausesNorMissingFramesNorClosePairsChangeIt) {
  UsualInterval interval;
  for (const std::int64_t t_ms : {0, 33, 66, 1066, 1099, 1165, 1167, 1200, 1233}) interval.add(t_ms * kMs);
  EXPECT_EQ(interval.ns(), 33 * kMs);
}

TEST(UsualInterval, FollowsTheLastNineIntervalsOnly) {
  UsualInterval interval;
  std::int64_t t_ns = 0;
  const auto add_frames = [&](int count, std::int64_t interval_ns) {
    for (int i = 0; i < count; ++i) interval.add(t_ns += interval_ns);
  };
  add_frames(20, 33 * kMs);
  add_frames(4, 100 * kMs);
  EXPECT_EQ(interval.ns(), 33 * kMs);
  add_frames(1, 100 * kMs);
  EXPECT_EQ(interval.ns(), 100 * kMs);
}

}  // namespace
}  // namespace twofold
