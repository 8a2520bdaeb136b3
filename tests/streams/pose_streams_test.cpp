#include "streams/pose_streams.hpp"

#include <gtest/gtest.h>

#include <future>

#include "tests/streams/numbered_poses.hpp"

namespace twofold {
namespace {

using testing::Heard;
using testing::numbered_pose;

/// Hands what it is offered to the test; waits at its gate while that is shut, as no real output does.
class GatedOutput final : public PoseOutput {
 public:
  struct Shared {
    std::atomic<bool> open{true};
    std::atomic<int> offers{0};
    std::string lines;         // read after the end
    std::uint64_t missed = 0;  // likewise
  };
  explicit GatedOutput(Shared& shared) : shared_(shared) {}

  void offer(const std::string& lines) override {
    ++shared_.offers;
    shared_.offers.notify_all();
    shared_.open.wait(false);
    shared_.lines += lines;
  }
  void miss(std::uint64_t lines) override { shared_.missed += lines; }

 private:
  Shared& shared_;
};

std::vector<std::unique_ptr<PoseOutput>> output_to(GatedOutput::Shared& shared) {
  std::vector<std::unique_ptr<PoseOutput>> outputs;
  outputs.push_back(std::make_unique<GatedOutput>(shared));
  return outputs;
}

TEST(PoseStreams, WhatWasToldIsWrittenInOrderBeforeTheEnd) {
  GatedOutput::Shared shared;
  PoseStreams streams(output_to(shared), PoseForm::kJson);
  MapEvent event;
  event.frame = 100;
  for (int i = 0; i < 100; ++i) streams.tell(numbered_pose(i));
  streams.tell(event);
  streams.finish();
  Heard heard;
  heard.take(shared.lines);
  ASSERT_EQ(heard.frames.size(), 101U);
  for (int i = 0; i <= 100; ++i) EXPECT_EQ(heard.frames[static_cast<std::size_t>(i)], i);
  EXPECT_EQ(shared.missed, 0U);
}

TEST(PoseStreams, AStuckWriterCostsTheTellerNothingAndTheLossIsCounted) {
  constexpr int kPoses = 5000;
  GatedOutput::Shared shared;
  shared.open = false;
  PoseStreams streams(output_to(shared), PoseForm::kJson);
  streams.tell(numbered_pose(0));
  shared.offers.wait(0);                                            // the writer is stuck
  for (int i = 1; i < kPoses; ++i) streams.tell(numbered_pose(i));  // comes back at all
  shared.open = true;
  shared.open.notify_all();
  streams.finish();
  Heard heard;
  heard.take(shared.lines);
  EXPECT_GT(shared.missed, 0U);
  EXPECT_EQ(heard.frames.size() + shared.missed, static_cast<std::size_t>(kPoses));
}

TEST(PoseStreams, TumFormLeavesOutWhatIsNoPose) {
  GatedOutput::Shared shared;
  PoseStreams streams(output_to(shared), PoseForm::kTum);
  PoseEstimate lost = numbered_pose(1);
  lost.state = TrackingState::kLost;
  streams.tell(lost);
  streams.tell(numbered_pose(2));
  streams.finish();
  EXPECT_EQ(shared.lines, "1.000000002 2 0.25 -1 0 0 0 1\n");
}

}  // namespace
}  // namespace twofold
