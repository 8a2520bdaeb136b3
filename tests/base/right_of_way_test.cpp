#include "base/right_of_way.hpp"

#include <gtest/gtest.h>

#include <future>
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

/// Whether work on another thread comes to its end though somebody has the right of way, or had it.
template <class Work>
bool goes_on(RightOfWay& right, const Work& work) {
  auto done = std::async(std::launch::async, work);
  const bool went_on = done.wait_for(10s) == std::future_status::ready;
  right.give_up();  // so that a thread that waits ends, too
  return went_on;
}

TEST(RightOfWay, AThreadThatNeverMadeWayGoesOn) {
  RightOfWay right;
  right.take();
  EXPECT_TRUE(goes_on(right, [] { make_way(); }));
}

TEST(RightOfWay, AThreadThatMakesWayGoesOnWhileNobodyHasIt) {
  RightOfWay right;
  right.take();
  right.give_up();
  EXPECT_TRUE(goes_on(right, [&] {
    const MakesWay makes_way(right, 1h);
    make_way();
  }));
}

TEST(RightOfWay, AThreadThatMakesWayNoMoreGoesOn) {
  RightOfWay right;
  right.take();
  EXPECT_TRUE(goes_on(right, [&] {
    { const MakesWay makes_way(right, 1h); }
    make_way();
  }));
}

}  // namespace
}  // namespace twofold
