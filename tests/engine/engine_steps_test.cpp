// A camera of few frames a second: each sees much that the one before did not.
#include <gtest/gtest.h>

#include <numbers>

#include "loopclosure/default_vocabulary.hpp"
#include "tests/engine/run_checks.hpp"

namespace twofold {
namespace {

constexpr int kFrames = 50;
constexpr double kTurn = 10 * std::numbers::pi / 180;  ///< from frame to frame [rad]
constexpr std::int64_t kInterval = 200'000'000;        // [ns]

/// On a circle, looking outwards: 8 cm and 10 degrees a frame, one round and a third of the next.
SE3 T_c_w(int i) {
  const double angle = kTurn * i;
  return SE3(SO3::exp(Vector3(0, angle, 0)), 0.45 * Vector3(std::sin(angle), 0, std::cos(angle))).inverse();
}

TEST(WideSteps, AreTakenWithoutASecondPartAndTheRoundIsClosed) {
  std::vector<Frame> frames = testing::render_walk(T_c_w, 0, kFrames, 5);
  for (Frame& frame : frames) frame.t_ns = 1'000'000'000 + frame.index * kInterval;
  const FrameFeed feed = [&, next = std::size_t{0}](Frame& frame) mutable {
    if (next == frames.size()) return FeedStatus::kEnd;
    frame = frames[next++];
    return FeedStatus::kFrame;
  };
  EngineOptions options;
  options.deterministic = true;
  options.vocabulary = std::make_shared<const Vocabulary>(load_default_vocabulary());
  const RunResult result = testing::run_engine(options, feed);
  ASSERT_EQ(result.frames.size(), frames.size());
  for (const FrameRecord& record : result.frames) {
    const int i = static_cast<int>(record.frame_index);
    ASSERT_EQ(record.state, FrameState::kTracked) << i << ": " << describe(record.cause);
    EXPECT_EQ(result.graph.part(record.reference), KeyframeId{0}) << i;
    EXPECT_LT(testing::position_error(record, result.graph, T_c_w(i) * T_c_w(0).inverse()), 0.03) << i;
  }
  EXPECT_GE(result.loops.size() + static_cast<std::size_t>(result.mapping.metric_loops), 1U);
}

}  // namespace
}  // namespace twofold
