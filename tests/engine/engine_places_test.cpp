#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <sstream>

#include "engine/engine.hpp"
#include "loopclosure/default_vocabulary.hpp"
#include "tests/engine/small_scene.hpp"
#include "tests/sanitized.hpp"

namespace twofold {
namespace {

using testing::render_walk;
using testing::small_rig;
constexpr auto T_c_w = testing::turning_walk;

/// A camera that turns by 90 degrees in a textured room; rendered once for all tests.
class EnginePlacesTest : public ::testing::Test {
 protected:
  static constexpr int kFrames = 45;
  static constexpr int kCovered = 5;
  static constexpr int kCarriedTo = 6;  // frame whose place the camera is carried to
  static constexpr int kAfter = 12;     // frames from there on, then it stands

  static void SetUpTestSuite() {
    mapped_ = new std::vector<Frame>(render_walk(T_c_w, 0, kFrames, 5));
    elsewhere_ = new std::vector<Frame>(render_walk(T_c_w, kCarriedTo, kCarriedTo + kAfter, 77));
  }
  static void TearDownTestSuite() {
    delete mapped_;
    delete elsewhere_;
  }

  /// Number of the frame of the walk shown as frame i; -1 while the lens is covered.
  static int shown(int i) {
    if (i < kFrames) return i;
    return i < kFrames + kCovered ? -1 : kCarriedTo + std::min(i - kFrames - kCovered, kAfter - 1);
  }
  static bool after_kidnapping(const FrameRecord& record) { return record.frame_index >= kFrames + kCovered; }

  /// The walk, a hand over the lens, and then, without having seen the way, a place of the walk, or of
  /// another room.
  static FrameFeed kidnapped(bool to_another_room, int after = kAfter) {
    return [to_another_room, after, next = 0](Frame& frame) mutable {
      if (next == kFrames + kCovered + after) return FeedStatus::kEnd;
      const int i = shown(next);
      if (i < 0) {
        frame.left = cv::Mat(240, 320, CV_8UC1, cv::Scalar(12));
        frame.right = frame.left;
      } else if (next >= kFrames && to_another_room) {
        frame = (*elsewhere_)[static_cast<std::size_t>(i - kCarriedTo)];
      } else {
        frame = (*mapped_)[static_cast<std::size_t>(i)];
      }
      testing::number_frame(frame, next);
      ++next;
      return FeedStatus::kFrame;
    };
  }

  static EngineOptions options(bool recognise = true) {
    EngineOptions options;
    options.deterministic = true;
    if (recognise) options.vocabulary = std::make_shared<const Vocabulary>(load_default_vocabulary());
    return options;
  }
  static RunResult run(const EngineOptions& options, const FrameFeed& frames) {
    std::atomic<bool> interrupted{false};
    return Engine(small_rig(), options).run(frames, interrupted);
  }

  static std::vector<Frame>*mapped_, *elsewhere_;
};

std::vector<Frame>* EnginePlacesTest::mapped_ = nullptr;
std::vector<Frame>* EnginePlacesTest::elsewhere_ = nullptr;

TEST_F(EnginePlacesTest, ACameraCarriedElsewhereFindsItselfInTheMap) {
  const RunResult result = run(options(), kidnapped(false));
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
    const SE3 T_c_first = final_T_c_w(record, result.graph) * result.graph.T_k_w(KeyframeId{0}).inverse();
    const SE3 T_c_first_true = T_c_w(shown(static_cast<int>(record.frame_index))) * T_c_w(0).inverse();
    EXPECT_LT((T_c_first.inverse().translation() - T_c_first_true.inverse().translation()).norm(), 0.03);
  }
  EXPECT_LE(lost, 3);
  EXPECT_GE(tracked, kAfter - 3);
}

TEST_F(EnginePlacesTest, WithoutRecognitionItStaysLost) {
  const RunResult result = run(options(false), kidnapped(false));
  for (const FrameRecord& record : result.frames) {
    if (after_kidnapping(record)) {
      EXPECT_EQ(record.state, FrameState::kLost) << record.frame_index;
    }
  }
}

TEST_F(EnginePlacesTest, InAnUnknownPlaceItSaysThatItIsLost) {
  const RunResult result = run(options(), kidnapped(true));
  for (const FrameRecord& record : result.frames) {
    if (after_kidnapping(record)) {
      EXPECT_EQ(record.state, FrameState::kLost) << record.frame_index;
    }
  }
}

/// Feeds frames one after the other; no image stands for a hand over the lens.
FrameFeed shown_in_turn(std::vector<Frame> frames) {
  return [frames = std::move(frames), next = 0](Frame& frame) mutable {
    if (next == static_cast<int>(frames.size())) return FeedStatus::kEnd;
    frame = frames[static_cast<std::size_t>(next)];
    if (frame.left.empty()) {
      frame.left = cv::Mat(240, 320, CV_8UC1, cv::Scalar(12));
      frame.right = frame.left;
    }
    testing::number_frame(frame, next);
    ++next;
    return FeedStatus::kFrame;
  };
}

/// The first half of the room; a hand; then from its other end back into the first half.
class MapPartsTest : public EnginePlacesTest {
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
    engine.tracker.new_part_after = 0.1;
    return engine;
  }
  static void expect_equal(const RunResult& a, const RunResult& b) {
    ASSERT_EQ(a.frames.size(), b.frames.size());
    for (std::size_t i = 0; i < a.frames.size(); ++i) {
      EXPECT_EQ(a.frames[i].state, b.frames[i].state) << i;
      EXPECT_EQ(a.frames[i].T_c_ref, b.frames[i].T_c_ref) << i;
      EXPECT_EQ(a.frames[i].T_c_w_causal, b.frames[i].T_c_w_causal) << i;
      EXPECT_EQ(a.frames[i].part_causal, b.frames[i].part_causal) << i;
    }
    ASSERT_EQ(a.graph.keyframe_count(), b.graph.keyframe_count());
    for (std::uint32_t k = 0; k < a.graph.keyframe_count(); ++k) {
      EXPECT_EQ(a.graph.T_k_w(KeyframeId{k}).matrix(), b.graph.T_k_w(KeyframeId{k}).matrix()) << k;
      EXPECT_EQ(a.graph.part(KeyframeId{k}), b.graph.part(KeyframeId{k})) << k;
    }
  }
};

TEST_F(MapPartsTest, ALostCameraStartsAPartThatJoinsWhenAPlaceOfBothIsRecognised) {
  const RunResult result = run(impatient(), frames());
  EXPECT_EQ(result.error, "");
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
    const SE3 T_c_first = final_T_c_w(record, result.graph) * result.graph.T_k_w(KeyframeId{0}).inverse();
    const SE3 T_c_first_true = T_c_w(walked(record.frame_index)) * T_c_w(0).inverse();
    EXPECT_LT((T_c_first.inverse().translation() - T_c_first_true.inverse().translation()).norm(), 0.03)
        << record.frame_index;
  }
  EXPECT_GE(parts.size(), 2U);  // as known at the time: old part, new part, one of them for both
  EXPECT_TRUE(announced);
  EXPECT_LE(lost, 5);
  EXPECT_TRUE(std::any_of(result.loops.begin(), result.loops.end(),
                          [](const ClosedLoop& loop) { return loop.joins_parts; }));
  for (std::uint32_t k = 0; k < result.graph.keyframe_count(); ++k) {
    EXPECT_EQ(result.graph.part(KeyframeId{k}), result.graph.part(KeyframeId{0}));
  }
}

TEST_F(MapPartsTest, TwoRunsGiveTheSameBytes) {
  expect_equal(run(impatient(), frames()), run(impatient(), frames()));
}

TEST_F(MapPartsTest, AThreadedRunReplays) {
  EngineOptions threaded = impatient();
  threaded.deterministic = false;
  threaded.pacing.speed = 1;
  const RunResult live = run(threaded, frames());
  ASSERT_EQ(live.error, "");
  std::stringstream file;
  ASSERT_TRUE(write_schedule(file, live.schedule.tracker, live.schedule.mapper, live.schedule.loop_closer));
  const auto schedule = read_schedule(file);
  ASSERT_TRUE(schedule) << schedule.error();
  std::atomic<bool> interrupted{false};
  const RunResult replayed = Engine(small_rig(), threaded).replay(frames(), *schedule, interrupted);
  EXPECT_EQ(replayed.error, "");
  expect_equal(live, replayed);
}

TEST_F(MapPartsTest, InAnUnknownPlaceThePartStaysApart) {
  const RunResult result = run(impatient(), kidnapped(true));
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

TEST_F(EnginePlacesTest, AThreadedRunWithRequestsAndAnswersReplays) {
  EngineOptions threaded = options();
  threaded.deterministic = false;
  threaded.pacing.speed = testing::kSanitized ? 0.1 : 1;
  constexpr int kUntilFound = 60;  // the answer must come before the recording ends, however busy the machine
  const RunResult live = run(threaded, kidnapped(false, kUntilFound));
  ASSERT_EQ(live.error, "");
  EXPECT_EQ(live.frames.back().state, FrameState::kTracked);
  EXPECT_EQ(live.graph.part(live.frames.back().reference), KeyframeId{0});
  std::stringstream file;
  ASSERT_TRUE(write_schedule(file, live.schedule.tracker, live.schedule.mapper, live.schedule.loop_closer));
  const auto schedule = read_schedule(file);
  ASSERT_TRUE(schedule) << schedule.error();
  const auto asked = [](const Schedule& s) {
    return std::count_if(s.loop_closer.begin(), s.loop_closer.end(),
                         [](const LoopStep& step) { return step.requests > 0; });
  };
  EXPECT_GT(asked(*schedule), 0);
  std::atomic<bool> interrupted{false};
  const RunResult replayed =
      Engine(small_rig(), threaded).replay(kidnapped(false, kUntilFound), *schedule, interrupted);
  EXPECT_EQ(replayed.error, "");
  ASSERT_EQ(replayed.frames.size(), live.frames.size());
  for (std::size_t i = 0; i < live.frames.size(); ++i) {
    EXPECT_EQ(live.frames[i].state, replayed.frames[i].state) << i;
    EXPECT_EQ(live.frames[i].T_c_ref, replayed.frames[i].T_c_ref) << i;
    EXPECT_EQ(live.frames[i].snapshot_version, replayed.frames[i].snapshot_version) << i;
  }
  for (std::uint32_t k = 0; k < live.graph.keyframe_count(); ++k) {
    EXPECT_EQ(live.graph.T_k_w(KeyframeId{k}).matrix(), replayed.graph.T_k_w(KeyframeId{k}).matrix()) << k;
  }
}

}  // namespace
}  // namespace twofold
