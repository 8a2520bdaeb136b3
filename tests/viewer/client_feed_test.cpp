#include "viewer/client_feed.hpp"

#include <gtest/gtest.h>

#include <cstring>

#include "tests/viewer/small_map.hpp"
#include "viewer/keyframe_images.hpp"

namespace twofold {
namespace {

using testing::small_map;
using testing::tracked_pose;

class ClientFeedTest : public ::testing::Test {
 protected:
  /// Everything the client gets, which deals with each message at once.
  std::vector<ViewMessage> drain(ClientFeed& feed) {
    std::vector<ViewMessage> messages;
    while (auto message = feed.next(sight_)) {
      messages.push_back(*message);
      EXPECT_TRUE(feed.take("ack"));
    }
    return messages;
  }
  static ViewMessageHeader header(const ViewMessage& message) {
    ViewMessageHeader header;
    std::memcpy(&header, message.bytes->data(), sizeof header);
    return header;
  }

  ViewScene scene_;
  ViewTitle title_{.title = "a \"title\" with \xff"};
  ViewSight sight_;
};

TEST_F(ClientFeedTest, GreetsThenTellsEverythingThenIsSilent) {
  scene_.show(small_map(3));
  scene_.add(tracked_pose(0, 0), {});
  MapEvent closed;
  closed.kind = MapEventKind::kLoopClosure;
  scene_.add(closed);
  ClientFeed feed(scene_, title_);
  const auto messages = drain(feed);
  ASSERT_EQ(messages.size(), 5U);
  EXPECT_TRUE(messages[0].text);
  EXPECT_NE(messages[0].bytes->find("\"hello\""), std::string::npos);
  EXPECT_NE(messages[1].bytes->find("\"mappingPaused\":false"), std::string::npos);
  EXPECT_NE(messages[2].bytes->find("loop closure"), std::string::npos);
  EXPECT_EQ(header(messages[3]).kind, ViewMessageKind::kFrames);
  EXPECT_EQ(header(messages[4]).kind, ViewMessageKind::kDelta);
  EXPECT_EQ(header(messages[4]).number, kWhole | kLast);
  EXPECT_TRUE(drain(feed).empty());
}

TEST_F(ClientFeedTest, NewestWins) {
  scene_.show(small_map(1));
  ClientFeed feed(scene_, title_);
  drain(feed);
  for (std::int64_t n = 0; n < 2000; ++n) scene_.add(tracked_pose(n, 0), {});
  for (std::uint32_t k = 2; k < 30; ++k) scene_.show(small_map(k, k));
  const auto messages = drain(feed);
  ASSERT_EQ(messages.size(), 2U) << "one of the newest frames, one that leads to the newest map";
  EXPECT_EQ(header(messages[0]).number, ViewScene::kLiveFrames);
  EXPECT_EQ(header(messages[1]).b, scene_.revision());
}

TEST_F(ClientFeedTest, WhoDealsWithNothingGetsNothingMore) {
  ClientFeed feed(scene_, title_);
  int messages = 0;
  for (std::int64_t n = 0; n < 1000; ++n) {
    scene_.add(tracked_pose(n, 0), {});
    while (feed.next(sight_)) ++messages;
  }
  EXPECT_EQ(messages, ClientFeed::kUnacknowledged);
  EXPECT_TRUE(feed.take("ack"));
  EXPECT_TRUE(feed.next(sight_));
}

TEST_F(ClientFeedTest, NonsenseIsRefused) {
  ClientFeed feed(scene_, title_);
  for (const std::string_view nonsense : {"", "ack", "acknowledge", "images", "images on ", "stop"})
    EXPECT_FALSE(ClientFeed(scene_, title_).take(nonsense)) << nonsense;
  EXPECT_TRUE(feed.take("images on"));
  EXPECT_TRUE(feed.wants_images());
}

TEST_F(ClientFeedTest, WhoAsksIsAnsweredThoughThereIsNothingNew) {
  ClientFeed feed(scene_, title_);
  drain(feed);
  EXPECT_FALSE(feed.next(sight_));
  EXPECT_TRUE(feed.take("still there?"));
  const auto answer = feed.next(sight_);
  ASSERT_TRUE(answer);
  EXPECT_TRUE(answer->text);
  EXPECT_EQ(*answer->bytes, "{}");
  EXPECT_TRUE(feed.take("ack"));
  EXPECT_FALSE(feed.next(sight_)) << "once";
}

TEST_F(ClientFeedTest, AcksAreNotTooMuchHoweverFastTheyCome) {
  ClientFeed feed(scene_, title_);
  const ClientFeed::Time now{std::chrono::hours(1)};
  int acks = 0;
  for (std::int64_t n = 0; n < 2000; ++n) {
    scene_.add(tracked_pose(n, 0), {});
    for (; feed.next(sight_); ++acks) EXPECT_TRUE(feed.take("ack", now));
  }
  EXPECT_GT(acks, 2 * ClientFeed::kMessagesASecond) << "of a large map, all within a second";
  int said = 0;
  while (said < 5000 && feed.take("images on", now)) ++said;
  EXPECT_EQ(said, ClientFeed::kMessagesASecond);
  EXPECT_TRUE(feed.take("images on", now + std::chrono::seconds(2)));
}

TEST_F(ClientFeedTest, ImagesGoToThoseWhoWantThem) {
  sight_.image.put("picture");
  ClientFeed with(scene_, title_), without(scene_, title_);
  EXPECT_TRUE(with.take("images on"));
  EXPECT_EQ(drain(with).back().bytes, sight_.image.bytes);
  EXPECT_EQ(drain(without).size(), 2U) << "greeting and state";
  EXPECT_TRUE(drain(with).empty()) << "the same image twice";
}

TEST_F(ClientFeedTest, WhatWasMeasuredComesBeforeItsFrame) {
  ClientFeed feed(scene_, title_);
  EXPECT_TRUE(feed.take("images on"));
  drain(feed);
  sight_.measured.put("points");
  scene_.add(tracked_pose(0, 0), {});
  const auto messages = drain(feed);
  ASSERT_GE(messages.size(), 2U);
  EXPECT_EQ(*messages[0].bytes, "points");
  EXPECT_EQ(header(messages[1]).kind, ViewMessageKind::kFrames);
}

TEST_F(ClientFeedTest, CommandsAreNonsenseUnlessTheyAreAllowed) {
  EXPECT_FALSE(ClientFeed(scene_, title_).take("stop"));
  title_.control = true;
  ClientFeed feed(scene_, title_);
  EXPECT_TRUE(feed.take_commands().empty());
  for (const char* wish : {"pause mapping", "save map", "stop", "pause mapping"})
    EXPECT_TRUE(feed.take(wish));
  EXPECT_EQ(feed.take_commands(),
            (std::vector{ViewCommand::kSaveMap, ViewCommand::kStop, ViewCommand::kPauseMapping}))
      << "none is lost, each comes once";
  EXPECT_TRUE(feed.take_commands().empty()) << "once";
  EXPECT_FALSE(feed.take("save map /etc/passwd"));
}

TEST_F(ClientFeedTest, StateIsWhatHoldsNowHoweverLongAgoItBegan) {
  ClientFeed feed(scene_, title_);
  drain(feed);
  scene_.set_mapping_paused(true);
  scene_.set_mapping_paused(true);
  const auto told = drain(feed);
  ASSERT_EQ(told.size(), 1U);
  EXPECT_NE(told[0].bytes->find("\"mappingPaused\":true"), std::string::npos);
  for (std::size_t n = 0; n <= ViewScene::kMaxEvents; ++n) scene_.add(MapEvent{});  // pausing is forgotten
  ClientFeed late(scene_, title_);
  EXPECT_NE(drain(late)[1].bytes->find("\"mappingPaused\":true"), std::string::npos);
}

TEST_F(ClientFeedTest, AKeyframesImageGoesToWhoAskedForIt) {
  EXPECT_FALSE(ClientFeed(scene_, title_).take("keyframe 3")) << "there are no images";
  title_.keyframe_images = true;
  for (const std::string_view nonsense :
       {"keyframe", "keyframe ", "keyframe -1", "keyframe +1", "keyframe 3 ", "keyframe 0x3",
        "keyframe 4294967296", "keyframe 4294967295", "keyframe ../3", "keyframe  3"})
    EXPECT_FALSE(ClientFeed(scene_, title_).take(nonsense)) << nonsense;
  ClientFeed feed(scene_, title_), other(scene_, title_);
  EXPECT_TRUE(feed.take("keyframe 4294967294"));
  EXPECT_TRUE(feed.take("keyframe 3"));
  EXPECT_EQ(feed.wanted_keyframe(), 3U) << "the last one";
  drain(feed);
  sight_.keyframe = 3;  // with no image yet
  EXPECT_TRUE(drain(feed).empty());
  sight_.keyframe = 2;
  sight_.keyframe_image.put("another's");
  EXPECT_TRUE(drain(feed).empty());
  sight_.keyframe = 3;
  sight_.keyframe_image.put("picture");
  const auto messages = drain(feed);
  ASSERT_EQ(messages.size(), 1U);
  EXPECT_EQ(*messages[0].bytes, "picture");
  EXPECT_FALSE(feed.wanted_keyframe());
  EXPECT_EQ(drain(other).size(), 2U) << "greeting and state, and nothing that it did not ask for";
}

TEST_F(ClientFeedTest, TheEndIsToldBeforeWhatIsLacking) {
  scene_.show(small_map(3));
  ClientFeed feed(scene_, title_);
  ASSERT_TRUE(feed.next(sight_));
  feed.end("that was all");
  const auto words = feed.next(sight_);
  ASSERT_TRUE(words);
  EXPECT_NE(words->bytes->find("that was all"), std::string::npos);
  EXPECT_FALSE(feed.is_done());
  const auto rest = drain(feed);
  ASSERT_EQ(rest.size(), 2U);
  EXPECT_EQ(header(rest[1]).number, kWhole | kLast);
  EXPECT_TRUE(feed.is_done());
}

TEST_F(ClientFeedTest, TheEndIsToldToWhoDealsWithNothing) {
  ClientFeed feed(scene_, title_);
  for (std::int64_t n = 0; n < 100; ++n) {
    scene_.add(tracked_pose(n, 0), {});
    while (feed.next(sight_)) continue;
  }
  feed.end("that was all");
  const auto words = feed.next(sight_);
  ASSERT_TRUE(words);
  EXPECT_NE(words->bytes->find("that was all"), std::string::npos);
  EXPECT_FALSE(feed.next(sight_));
}

}  // namespace
}  // namespace twofold
