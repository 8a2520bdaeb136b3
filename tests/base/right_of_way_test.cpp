#include "base/right_of_way.hpp"

#include <gtest/gtest.h>

#include <thread>

namespace twofold {
namespace {

using namespace std::chrono_literals;

TEST(RightOfWay, IsTakenForAScope) {
  RightOfWay right;
  {
    const RightOfWayTaken taken(&right);
    EXPECT_TRUE(right.taken());
  }
  EXPECT_FALSE(right.taken());
  const RightOfWayTaken nobodys(nullptr);
}

TEST(RightOfWay, WhoMakesWayWaitsUntilItIsGivenUp) {
  RightOfWay right;
  right.take();
  std::atomic<bool> went_on{false};
  std::jthread other([&] {
    const MakesWay makes_way(right, 1h);
    make_way();
    went_on = true;
  });
  std::this_thread::sleep_for(20ms);
  EXPECT_FALSE(went_on);
  right.give_up();
  other.join();
  EXPECT_TRUE(went_on);
}

TEST(RightOfWay, NobodyWaitsForEverAndAfterwardsForAWhileNotAtAll) {
  RightOfWay right;
  right.take();
  const MakesWay makes_way(right, 1s);
  const auto begin = std::chrono::steady_clock::now();
  make_way();
  const auto waited = std::chrono::steady_clock::now();
  EXPECT_GE(waited - begin, 1s);
  for (int n = 0; n < 100; ++n) make_way();
  EXPECT_LT(std::chrono::steady_clock::now() - waited, 1s) << "it has waited again";
}

TEST(RightOfWay, OtherThreadsGoOn) {
  RightOfWay right;
  right.take();
  make_way();  // never made way for anybody
  {
    const MakesWay makes_way(right, 1h);
    right.give_up();
    make_way();  // not taken
  }
  right.take();
  make_way();  // does so no more
}

}  // namespace
}  // namespace twofold
