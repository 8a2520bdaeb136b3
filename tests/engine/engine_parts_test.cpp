// A lost camera starts a part of the map, which joins another when a place of both is recognised.
#include <gtest/gtest.h>

#include <algorithm>

#include "tests/engine/kidnapped_camera.hpp"

namespace twofold {
namespace {

using testing::expect_replay;
using testing::expect_same;
using testing::position_error;
using testing::run_engine;

/// Feeds frames one after the other; no image stands for a hand over the lens.
FrameFeed shown_in_turn(std::vector<Frame> frames) {
  return [frames = std::move(frames), next = 0](Frame& frame) mutable {
    if (next == static_cast<int>(frames.size())) return FrameStatus::kEnd;
    frame = frames[static_cast<std::size_t>(next)];
    if (frame.left.empty()) {
      frame.left = cv::Mat(240, 320, CV_8UC1, cv::Scalar(12));
      frame.right = frame.left;
    }
    testing::number_frame(frame, next);
    ++next;
    return FrameStatus::kFrame;
  };
}

/// The first half of the room; a hand; then from its other end back into the first half.
class MapPartsTest : public testing::KidnappedCamera {
 protected:
  static constexpr int kFirst = 24;
  static constexpr int kLast = 4;
  static FrameFeed frames() {
    std::vector<Frame> shown(mapped_->begin(), mapped_->begin() + kFirst);
    shown.resize(kFirst + kCovered);
    for (int i = kFrames - 1; i >= kLast; --i) shown.push_back((*mapped_)[static_cast<std::size_t>(i)]);
    return shown_in_turn(std::move(shown));
  }
  /// Frame of the walk that is shown as frame i, or -1.
  static int walked(std::int64_t i) {
    if (i < kFirst) return static_cast<int>(i);
    return i < kFirst + kCovered ? -1 : static_cast<int>(kFrames - 1 - (i - kFirst - kCovered));
  }
  static EngineOptions impatient() {
    EngineOptions engine = options();
    engine.tracker.loss.new_part_after = 0.1;
    engine.tracker.loss.wide_search.enabled = false;  // it would find the room again before a part is started
    return engine;
  }
};

TEST_F(MapPartsTest, ALostCameraStartsAPartThatJoinsWhenAPlaceOfBothIsRecognised) {
  EngineOptions engine = impatient();
  std::size_t loops_told = 0;
  engine.on_loop = [&loops_told](const ClosedLoop&) { ++loops_told; };
  const RunResult result = run_engine(engine, frames());
  EXPECT_EQ(result.error, "");
  EXPECT_EQ(loops_told, result.loops.size());
  std::vector<KeyframeId> parts;
  const bool announced = std::any_of(
      result.corrections.begin(), result.corrections.end(),
      [](const PoseCorrection& correction) { return correction.reason == CorrectionReason::kPartsJoined; });
  int lost = 0;
  for (const FrameRecord& record : result.frames) {
    if (walked(record.frame_index) < 0) continue;
    lost += record.state != FrameState::kTracked ? 1 : 0;
    if (record.state != FrameState::kTracked) continue;
    if (parts.empty() || parts.back() != record.part_causal) parts.push_back(record.part_causal);
    const SE3 T_c_first_true = T_c_w(walked(record.frame_index)) * T_c_w(0).inverse();
    EXPECT_LT(position_error(record, result.graph, T_c_first_true), 0.03) << record.frame_index;
  }
  EXPECT_GE(parts.size(), 2U);  // as known at the time: old part, new part, one of them for both
  EXPECT_TRUE(announced);
  EXPECT_LE(lost, 5);
  EXPECT_TRUE(std::any_of(result.loops.begin(), result.loops.end(),
                          [](const ClosedLoop& loop) { return loop.joins_parts; }));
  for (const ClosedLoop& loop : result.loops) {
    EXPECT_LT(loop.from_t_ns, loop.t_ns) << "whatever stands for the older keyframe in the final map";
    EXPECT_TRUE(std::any_of(result.frames.begin(), result.frames.end(), [&](const FrameRecord& record) {
      return record.keyframe && record.t_ns == loop.from_t_ns;
    }));
  }
  for (std::uint32_t k = 0; k < result.graph.keyframe_count(); ++k) {
    EXPECT_EQ(result.graph.part(KeyframeId{k}), result.graph.part(KeyframeId{0}));
  }
}

TEST_F(MapPartsTest, ALoopThatTheMapperNeverGetsIsNotClosed) {
  Schedule schedule = testing::schedule_of(run_engine(impatient(), frames()));
  for (LoopStep& step : schedule.loop_closer) {
    if (step.keyframe >= 0) step.refused = 9;  // more than there are
  }
  schedule.ended = false;  // it goes on as far as it can without a loop
  EngineOptions engine = impatient();
  std::size_t loops_told = 0;
  engine.on_loop = [&loops_told](const ClosedLoop&) { ++loops_told; };
  const RunResult replayed = testing::replay_engine(engine, frames(), schedule);
  EXPECT_EQ(replayed.mapping.loops, 0);
  EXPECT_TRUE(replayed.loops.empty());
  EXPECT_EQ(loops_told, 0U);
}

TEST_F(MapPartsTest, TheWiderSearchPlacesItWhereItIsOrNotAtAll) {
  EngineOptions patient = options(false);
  patient.tracker.loss.new_part_after = 10;
  const RunResult result = run_engine(patient, frames());
  int found = 0;
  for (const FrameRecord& record : result.frames) {
    const int i = walked(record.frame_index);
    if (i < 0 || record.state != FrameState::kTracked) continue;
    found += record.frame_index >= kFirst + kCovered ? 1 : 0;
    EXPECT_LT(position_error(record, result.graph, T_c_w(i) * T_c_w(0).inverse()), 0.03)
        << record.frame_index;
  }
  EXPECT_GE(found, 20);
}

TEST_F(MapPartsTest, TwoRunsGiveTheSameBytes) {
  expect_same(run_engine(impatient(), frames()), run_engine(impatient(), frames()));
}

TEST_F(MapPartsTest, AThreadedRunReplays) {
  EngineOptions threaded = impatient();
  threaded.deterministic = false;
  threaded.pacing.speed = 1;
  const RunResult live = run_engine(threaded, frames());
  ASSERT_EQ(live.error, "");
  expect_replay(threaded, frames(), live);
}

TEST_F(MapPartsTest, InAnUnknownPlaceThePartStaysApart) {
  const RunResult result = run_engine(impatient(), kidnapped(true));
  EXPECT_EQ(result.error, "");
  int tracked = 0;
  KeyframeId part = kNoKeyframe;
  SE3 T_start_w;
  for (const FrameRecord& record : result.frames) {
    if (!after_kidnapping(record) || record.state != FrameState::kTracked) continue;
    const SE3 T_c_w_true = T_c_w(shown(static_cast<int>(record.frame_index)));
    if (tracked++ == 0) {
      part = record.part_causal;
      T_start_w = T_c_w_true;
      EXPECT_EQ(record.T_c_w_causal.unpacked().matrix(), SE3().matrix());
    }
    EXPECT_EQ(record.part_causal, part);
    EXPECT_NE(record.part_causal, KeyframeId{0});
    EXPECT_EQ(result.graph.part(record.reference), part);
    // Its world is where it started, with nothing of the old part in it.
    EXPECT_LT(
        (record.T_c_w_causal.unpacked() * (T_c_w_true * T_start_w.inverse()).inverse()).translation().norm(),
        0.03);
  }
  EXPECT_GE(tracked, kAfter - 5);
}

}  // namespace
}  // namespace twofold
