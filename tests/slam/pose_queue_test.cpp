#include "twofold/pose_queue.hpp"

#include <gtest/gtest.h>

#include <thread>

namespace twofold {
namespace {

PoseEstimate numbered(std::int64_t frame) {
  PoseEstimate pose;
  pose.frame = frame;
  return pose;
}

std::int64_t frame_of(const PoseOrEvent& item) {
  return std::visit([](const auto& value) { return value.frame; }, item);
}

TEST(PoseQueue, GivesWhatWasPutInOrderAndThenTheEnd) {
  PoseQueue queue(4);
  PoseOrEvent item;
  EXPECT_EQ(queue.next(item, 0), QueueStatus::kTimeout);
  queue.put(numbered(1));
  MapEvent event;
  event.frame = 2;
  queue.put(event);
  queue.close();
  EXPECT_EQ(queue.next(item), QueueStatus::kItem);
  EXPECT_TRUE(std::holds_alternative<PoseEstimate>(item));
  EXPECT_EQ(queue.next(item), QueueStatus::kItem);
  EXPECT_EQ(std::get<MapEvent>(item).frame, 2);
  EXPECT_EQ(queue.next(item), QueueStatus::kEnd);
}

TEST(PoseQueue, WhatHasNoRoomIsCounted) {
  PoseQueue queue(4);
  for (int i = 0; i < 7; ++i) queue.put(numbered(i));
  EXPECT_EQ(queue.take_missed(), 3U);
  EXPECT_EQ(queue.take_missed(), 0U);
  PoseOrEvent item;
  for (int i = 0; i < 4; ++i) {
    ASSERT_EQ(queue.next(item, 0), QueueStatus::kItem);
    EXPECT_EQ(frame_of(item), i);
  }
}

TEST(PoseQueue, NothingIsMissedByWhoWaitsForRoom) {
  constexpr int kItems = 20'000;
  PoseQueue queue(8);
  std::thread teller([&] {
    for (int i = 0; i < kItems; ++i) {
      ASSERT_TRUE(queue.wait_for_room(1));
      queue.put(numbered(i));
    }
    queue.close();
  });
  PoseOrEvent item;
  std::int64_t expected = 0;
  while (queue.next(item) == QueueStatus::kItem) EXPECT_EQ(frame_of(item), expected++);
  teller.join();
  EXPECT_EQ(expected, kItems);
  EXPECT_EQ(queue.take_missed(), 0U);
}

TEST(PoseQueue, AnyCapacityIsRoundedUpButNoneAndTooMany) {
  PoseQueue queue(500);
  for (int i = 0; i < 512; ++i) queue.put(PoseEstimate{});
  EXPECT_EQ(queue.take_missed(), 0U);
  queue.put(PoseEstimate{});
  EXPECT_EQ(queue.take_missed(), 1U);
  EXPECT_THROW(PoseQueue(0), std::invalid_argument);
  EXPECT_THROW(PoseQueue(std::size_t{1} << 40), std::invalid_argument);
}

TEST(PoseQueue, NoneWaitsForRoomThatIsNeverThere) {
  PoseQueue queue(3);
  EXPECT_TRUE(queue.wait_for_room(4, 0)) << "the capacity is rounded up";
  queue.put(numbered(0));
  EXPECT_FALSE(queue.wait_for_room(4, 0));
  EXPECT_THROW((void)queue.wait_for_room(5, 0), std::invalid_argument);
  EXPECT_THROW((void)queue.wait_for_room(std::numeric_limits<std::size_t>::max(), 0), std::invalid_argument);
}

TEST(PoseQueue, TheLongestTimeIsForEver) {
  PoseQueue queue;
  std::thread closer([&] {
    std::this_thread::sleep_for(std::chrono::milliseconds(20));
    queue.close();
  });
  PoseOrEvent item;
  EXPECT_EQ(queue.next(item, std::numeric_limits<std::int64_t>::max()), QueueStatus::kEnd);
  closer.join();
}

TEST(PoseQueue, ClosingWakesWhoWaits) {
  PoseQueue queue(2);
  queue.put(numbered(0));
  queue.put(numbered(1));
  EXPECT_FALSE(queue.wait_for_room(1, 1'000'000));
  std::thread pacer([&] { EXPECT_FALSE(queue.wait_for_room(1)); });
  queue.close();
  pacer.join();
  EXPECT_TRUE(queue.closed());
}

}  // namespace
}  // namespace twofold
