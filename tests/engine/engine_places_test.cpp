#include <gtest/gtest.h>

#include <algorithm>

#include "engine/runners.hpp"
#include "mapping/culling.hpp"
#include "tests/engine/kidnapped_camera.hpp"
#include "tests/mapping/small_graphs.hpp"
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
  blind.tracker.loss.wide_search.enabled = false;
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

// When the loop closer takes a loop that it sent for one that the map has: only then is all of the map
// optimised, and, with one camera, the next loop sent.

constexpr KeyframeId kTo{2}, kFrom{18};

struct ChainWithLoop {
  GraphWriter writer = chain(22);
  LoopConstraint loop;

  ChainWithLoop() {
    loop.snapshot_version = writer.publish().version();
    loop.from = kFrom;
    loop.to = kTo;
  }
  /// As the mapper does, between the keyframes that stand for the loop's.
  void take() {
    const KeyframeId from = writer.graph().live_replacement(kFrom)->id;
    const KeyframeId to = writer.graph().live_replacement(kTo)->id;
    link_marginalised(writer, from, to, 10, SE3());
  }
  [[nodiscard]] bool arrived() { return has_arrived(writer.publish(), loop); }
};

TEST(ArrivedLoop, IsSeenByItsEdge) {
  ChainWithLoop map;
  EXPECT_FALSE(map.arrived());
  map.take();
  EXPECT_TRUE(map.arrived());
}

TEST(ArrivedLoop, IsSeenWhenEitherKeyframeIsCulledAfterwards) {
  for (const std::vector<KeyframeId>& culled : {std::vector{kFrom}, {kTo}, {kFrom, kTo}, {kTo, kFrom}}) {
    ChainWithLoop map;
    map.take();
    for (const KeyframeId id : culled) (void)remove_keyframe(map.writer, id);
    EXPECT_TRUE(map.arrived()) << culled.size() << " culled, " << index(culled.front()) << " first";
  }
}

TEST(ArrivedLoop, IsSeenWhereItsEdgeEndedBesideOthers) {
  ChainWithLoop map;
  map.take();
  const KeyframeId before{index(kFrom) - 1}, after{index(kFrom) + 1}, beside{index(kTo) + 1};
  for (const KeyframeId neighbour : {before, after}) link(map.writer, neighbour, beside, 5);
  (void)remove_keyframe(map.writer, kFrom);
  const KeyframeId replacement = map.writer.graph().live_replacement(kFrom)->id;
  ASSERT_EQ(find_edge(map.writer.graph().keyframe(replacement), kTo), nullptr);
  EXPECT_TRUE(map.arrived());
}

/// The mapper was at work on a version that it began without the loop.
TEST(ArrivedLoop, IsWaitedForWhenItsKeyframesAreCulledBefore) {
  for (const KeyframeId culled : {kFrom, kTo}) {
    ChainWithLoop map;
    (void)remove_keyframe(map.writer, culled);
    EXPECT_FALSE(map.arrived()) << index(culled);
    map.take();
    EXPECT_TRUE(map.arrived()) << index(culled);
  }
}

TEST(ArrivedLoop, IsNotWaitedForForEver) {
  ChainWithLoop lost;
  int versions = 1;
  while (!lost.arrived()) ASSERT_LT(++versions, 100);
  EXPECT_GT(versions, 10);
  ChainWithLoop forgotten;
  (void)remove_keyframe(forgotten.writer, kTo);
  forgotten.writer.keep_needed_replacements();
  EXPECT_TRUE(forgotten.arrived());
}

}  // namespace
}  // namespace twofold
