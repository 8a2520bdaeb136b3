#include <gtest/gtest.h>
#include <zmq.h>

#include <memory>

#include "streams/pose_output.hpp"
#include "tests/io/scratch_folder.hpp"
#include "tests/streams/numbered_poses.hpp"

namespace twofold {
namespace {

using testing::Heard;
using testing::numbered_pose;

/// Somebody else's end of zmq:ENDPOINT.
class Subscriber {
 public:
  explicit Subscriber(const std::string& endpoint) {
    zmq_setsockopt(socket_.get(), ZMQ_SUBSCRIBE, "", 0);
    EXPECT_EQ(zmq_connect(socket_.get(), endpoint.c_str()), 0);
  }

  /// Takes one message, if it comes within the time.
  bool take(Heard& heard, int timeout_ms) {
    zmq_setsockopt(socket_.get(), ZMQ_RCVTIMEO, &timeout_ms, sizeof timeout_ms);
    std::string message(65536, '\0');
    const int size = zmq_recv(socket_.get(), message.data(), message.size(), 0);
    if (size < 0) return false;
    message.resize(static_cast<std::size_t>(size));
    heard.take(message);
    return true;
  }

 private:
  std::unique_ptr<void, int (*)(void*)> context_{zmq_ctx_new(), zmq_ctx_term};
  std::unique_ptr<void, int (*)(void*)> socket_{zmq_socket(context_.get(), ZMQ_SUB), zmq_close};
};

class ZmqOutputTest : public ::testing::Test {
 protected:
  void offer() { output_->offer(pose_line(numbered_pose(next_++), PoseForm::kJson)); }
  /// Whoever subscribes is there a little later: offers poses until one arrives.
  void wait_for(Subscriber& subscriber, Heard& heard) {
    for (int turn = 0; turn < 1000 && heard.frames.empty(); ++turn) {
      offer();
      (void)subscriber.take(heard, 10);
    }
    while (!heard.frames.empty() && heard.frames.back() + 1 < next_)
      ASSERT_TRUE(subscriber.take(heard, 5000));
  }

  const ScratchFolder folder_;
  const std::string endpoint_ = "ipc://" + (folder_ / "poses");
  const std::unique_ptr<PoseOutput> output_ = open_pose_output("zmq:" + endpoint_, PoseForm::kJson);
  std::int64_t next_ = 0;
};

TEST_F(ZmqOutputTest, ASubscriberGetsEveryPoseWhole) {
  Subscriber subscriber(endpoint_);
  Heard heard;
  wait_for(subscriber, heard);
  ASSERT_FALSE(heard.frames.empty());
  const std::int64_t first = heard.frames.front();
  for (int i = 0; i < 100; ++i) offer();
  while (heard.frames.back() + 1 < next_) ASSERT_TRUE(subscriber.take(heard, 5000));
  for (std::size_t i = 0; i < heard.frames.size(); ++i)
    EXPECT_EQ(heard.frames[i], first + static_cast<std::int64_t>(i));
}

TEST_F(ZmqOutputTest, OneThatNeverReadsHoldsUpNobody) {
  Subscriber dead(endpoint_), alive(endpoint_);
  Heard by_dead, heard;
  wait_for(dead, by_dead);
  wait_for(alive, heard);
  ASSERT_FALSE(heard.frames.empty());
  const std::int64_t first = heard.frames.front();
  for (int i = 0; i < 5000; ++i) {
    offer();
    ASSERT_TRUE(alive.take(heard, 5000));
  }
  EXPECT_EQ(heard.frames.back() - first + 1, static_cast<std::int64_t>(heard.frames.size()));
}

TEST_F(ZmqOutputTest, SubscribersAreToldWhatWasLostOnTheWay) {
  Subscriber subscriber(endpoint_);
  Heard heard;
  wait_for(subscriber, heard);
  output_->miss(17);
  offer();
  while (heard.missed == 0) ASSERT_TRUE(subscriber.take(heard, 5000));
  EXPECT_EQ(heard.missed, 17);
}

TEST(ZmqOutput, TheFormOfAnEndpointIsSaid) {
  try {
    (void)open_pose_output("zmq:localhost:5556", PoseForm::kJson);
    FAIL();
  } catch (const std::runtime_error& error) {
    EXPECT_STREQ(error.what(), "zmq:localhost:5556: the form is zmq:tcp://HOST:PORT or zmq:ipc://PATH");
  }
}

}  // namespace
}  // namespace twofold
