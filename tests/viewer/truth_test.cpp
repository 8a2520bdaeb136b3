#include "viewer/truth.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

namespace twofold {
namespace {

constexpr std::int64_t kPoseInterval = 1'000'000'000;  // of the true ones [ns]

/// True poses along x, one a second.
struct Walk {
  std::vector<Pose> poses;
  std::vector<std::int64_t> t_ns;

  explicit Walk(int seconds, double speed = 1) {
    for (int n = 0; n < seconds; ++n) {
      poses.push_back({.q = {0, 0, 0, 1}, .t = {speed * n, 0, 0}});
      t_ns.push_back(n * kPoseInterval);
    }
  }
};

/// What one camera makes of it: its world is turned by 90 degrees about z and has another unit.
TrackedPose tracked(int second, double unit, std::uint32_t part = 0) {
  const double half = std::numbers::sqrt2 / 2;
  return {second * kPoseInterval, {.q = {0, 0, half, half}, .t = {5, unit * second, 2}}, part};
}

TEST(TruthBesideTest, StandsWhereTheFirstTrackedPoseDoes) {
  const Walk walk(10);
  TruthBeside beside(walk.poses, walk.t_ns, false);
  const auto truth = beside.add(tracked(3, 1, 4));
  ASSERT_TRUE(truth);
  EXPECT_EQ(truth->part, 4U);
  EXPECT_EQ(truth->scale, 1);
  ASSERT_EQ(truth->path.size(), 10U);
  EXPECT_NEAR(truth->path[3][1], 5, 1e-5);
  EXPECT_NEAR(truth->path[9][2], 3 + 6, 1e-5) << "six metres on, along y of that world";
  EXPECT_NEAR(truth->path[9][0], 6, 1e-6) << "seconds after that pose";
  EXPECT_FALSE(beside.add(tracked(8, 1, 4))) << "it stays there";
}

TEST(TruthBesideTest, TakesTheUnitOfOneCamera) {
  const Walk walk(10);
  TruthBeside beside(walk.poses, walk.t_ns, true);
  EXPECT_FALSE(beside.add(tracked(2, 0.25))) << "one pose has no length";
  const auto truth = beside.add(tracked(3, 0.25));
  ASSERT_TRUE(truth);
  EXPECT_NEAR(truth->scale, 0.25, 1e-9);
  EXPECT_NEAR(truth->path[9][2], 0.25 * 9, 1e-5);
}

TEST(TruthBesideTest, LooksAgainWhenTheCameraHasComeHalfAsFarAgain) {
  const Walk walk(40);
  TruthBeside beside(walk.poses, walk.t_ns, true);
  EXPECT_FALSE(beside.add(tracked(0, 0.25)));
  std::vector<int> laid;
  for (int second = 1; second < 40; ++second)
    if (beside.add(tracked(second, 0.25))) laid.push_back(second);
  EXPECT_EQ(laid, (std::vector<int>{1, 2, 3, 5, 8, 12, 18, 27}));
}

TEST(TruthBesideTest, WaitsForAWayOfThatPart) {
  const Walk walk(10, 0.01);
  TruthBeside beside(walk.poses, walk.t_ns, true);
  EXPECT_FALSE(beside.add(tracked(0, 0.01)));
  EXPECT_FALSE(beside.add(tracked(4, 0.01))) << "4 % of the median depth";
  EXPECT_FALSE(beside.add(tracked(9, 1, 1))) << "another world";
  EXPECT_TRUE(beside.add(tracked(6, 0.01)));
}

TEST(TruthBesideTest, NothingOfWhatDoesNotFit) {
  const Walk walk(10);
  TruthBeside none({}, {}, false), unequal(walk.poses, {0, kPoseInterval}, false),
      still(Walk(10, 0).poses, walk.t_ns, true);
  EXPECT_FALSE(none.add(tracked(0, 1)));
  EXPECT_FALSE(unequal.add(tracked(0, 1)));
  (void)still.add(tracked(0, 1));
  EXPECT_FALSE(still.add(tracked(5, 1))) << "the truth stands still";
}

TEST(TruthBesideTest, LongOnesAreThinnedOut) {
  const Walk walk(100'000);
  TruthBeside beside(walk.poses, walk.t_ns, false);
  const auto truth = beside.add(tracked(0, 1));
  ASSERT_TRUE(truth);
  EXPECT_LE(truth->path.size(), 4096U);
  EXPECT_GT(truth->path.size(), 2048U);
}

}  // namespace
}  // namespace twofold
