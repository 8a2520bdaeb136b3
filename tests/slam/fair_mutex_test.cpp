#include "slam/fair_mutex.hpp"

#include <gtest/gtest.h>

#include <string>
#include <thread>

namespace twofold {
namespace {

TEST(FairMutex, WhoComesBackWaitsForThoseWhoWereThere) {
  FairMutex mutex;
  std::string order;
  mutex.lock();
  std::jthread other([&] {
    mutex.lock();
    order += 'b';
    mutex.unlock();
  });
  while (mutex.queue() < 2) std::this_thread::yield();
  EXPECT_FALSE(mutex.try_lock());
  order += 'a';
  mutex.unlock();
  mutex.lock();  // at once
  order += 'a';
  mutex.unlock();
  EXPECT_EQ(order, "aba");
}

}  // namespace
}  // namespace twofold
