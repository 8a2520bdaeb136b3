#include <gtest/gtest.h>

#include <algorithm>

#include "tests/engine/kidnapped_camera.hpp"
#include "tests/sanitized.hpp"

namespace twofold {
namespace {

using testing::expect_replay;
using testing::position_error;
using testing::run_engine;
using testing::schedule_of;
using EnginePlacesTest = testing::KidnappedCamera;

TEST_F(EnginePlacesTest, ACameraCarriedElsewhereFindsItselfInTheMap) {
  const RunResult result = run_engine(options(), kidnapped(false));
  EXPECT_EQ(result.error, "");
  int lost = 0, tracked = 0;
  for (const FrameRecord& record : result.frames) {
    if (!after_kidnapping(record)) continue;
    if (record.state != FrameState::kTracked) {
      EXPECT_EQ(tracked, 0) << "lost again at " << record.frame_index;
      ++lost;
      continue;
    }
    ++tracked;
    const SE3 T_c_first_true = T_c_w(shown(static_cast<int>(record.frame_index))) * T_c_w(0).inverse();
    EXPECT_LT(position_error(record, result.graph, T_c_first_true), 0.03);
  }
  EXPECT_LE(lost, 3);
  EXPECT_GE(tracked, kAfter - 3);
}

TEST_F(EnginePlacesTest, WithoutRecognitionAndWiderSearchItStaysLost) {
  EngineOptions blind = options(false);
  blind.tracker.wide_search.enabled = false;
  const RunResult result = run_engine(blind, kidnapped(false));
  for (const FrameRecord& record : result.frames) {
    if (after_kidnapping(record)) {
      EXPECT_EQ(record.state, FrameState::kLost) << record.frame_index;
    }
  }
}

TEST_F(EnginePlacesTest, InAnUnknownPlaceItSaysThatItIsLost) {
  const RunResult result = run_engine(options(), kidnapped(true));
  for (const FrameRecord& record : result.frames) {
    if (after_kidnapping(record)) {
      EXPECT_EQ(record.state, FrameState::kLost) << record.frame_index;
    }
  }
}

TEST_F(EnginePlacesTest, AThreadedRunWithRequestsAndAnswersReplays) {
  EngineOptions threaded = options();
  threaded.deterministic = false;
  threaded.pacing.speed = testing::kSanitized ? 0.1 : 1;
  constexpr int kUntilFound = 60;  // the answer must come before the recording ends, however busy the machine
  const RunResult live = run_engine(threaded, kidnapped(false, kUntilFound));
  ASSERT_EQ(live.error, "");
  EXPECT_EQ(live.frames.back().state, FrameState::kTracked);
  EXPECT_EQ(live.graph.part(live.frames.back().reference), KeyframeId{0});
  const Schedule schedule = schedule_of(live);
  const auto asked = [](const Schedule& s) {
    return std::count_if(s.loop_closer.begin(), s.loop_closer.end(),
                         [](const LoopStep& step) { return step.requests > 0; });
  };
  EXPECT_GT(asked(schedule), 0);
  expect_replay(threaded, kidnapped(false, kUntilFound), live);
}

}  // namespace
}  // namespace twofold
