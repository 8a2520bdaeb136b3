#include "engine/logs/replacement_log.hpp"

#include <gtest/gtest.h>

#include <random>

#include "graph/graph_writer.hpp"
#include "tests/random_pose.hpp"

namespace twofold {
namespace {

/// Frames of keyframes that are culled, and whose replacements are culled, round after round, while the map
/// forgets and the live_replacements move: in the end each frame is where the map would have it that forgets
/// nothing.
TEST(ReplacementLog, FramesOfForgottenKeyframesKeepTheirPlace) {
  std::mt19937 rng(1);
  GraphWriter forgetful, faithful;
  ReplacementLog replacement_log;
  std::vector<KeyframeId> live;
  RecordSequence<FrameRecord> frames;
  const auto cull = [&](std::size_t n) {
    const KeyframeId id = live[n];
    live.erase(live.begin() + static_cast<std::ptrdiff_t>(n));
    const KeyframeId replacement = live[rng() % live.size()];
    for (GraphWriter* writer : {&forgetful, &faithful}) writer->cull_keyframe(id, replacement);
    return id;
  };
  for (std::uint32_t k = 0; k < 400; ++k) {
    Keyframe keyframe;
    keyframe.id = KeyframeId{k};
    keyframe.T_k_w = random_pose(rng);
    for (GraphWriter* writer : {&forgetful, &faithful}) writer->add_keyframe(keyframe);
    live.push_back(keyframe.id);
    for (int n = 0; n < 3; ++n) {
      FrameRecord frame;
      frame.state = FrameState::kTracked;
      frame.reference = live[rng() % live.size()];
      frame.T_c_ref = PackedPose(random_pose(rng));
      frames.push_back(frame);
    }
    frames.push_back({});  // a lost one
    const KeyframeId moved = live[rng() % live.size()];
    const SE3 T_moved_w = random_pose(rng);
    for (GraphWriter* writer : {&forgetful, &faithful}) writer->set_pose(moved, T_moved_w);
    if (live.size() < 8) continue;
    // Two in a round, the second maybe the replacement of the first.
    const KeyframeId first = cull(rng() % live.size());
    const KeyframeId second = cull(rng() % live.size());
    forgetful.forget_replacements(2);
    for (const KeyframeId id : {first, second}) replacement_log.add(id, forgetful.graph());
  }
  const std::vector<FrameRecord> before(frames.begin(), frames.end());
  replacement_log.hang_on_live_keyframes(frames);
  int hung_anew = 0;
  for (std::size_t n = 0; n < frames.size(); ++n) {
    if (frames[n].state != FrameState::kTracked) {
      EXPECT_EQ(frames[n].reference, kNoKeyframe);
      continue;
    }
    ASSERT_FALSE(forgetful.graph().keyframe(frames[n].reference).culled());
    const SE3 T_c_w = final_T_c_w(frames[n], forgetful.graph());
    const SE3 T_c_w_expected = final_T_c_w(before[n], faithful.graph());
    ASSERT_LT((T_c_w * T_c_w_expected.inverse()).log().norm(), 1e-12) << n;
    hung_anew += frames[n].reference != before[n].reference ? 1 : 0;
  }
  EXPECT_GT(hung_anew, 1000);
  EXPECT_FALSE(forgetful.graph().live_replacement(before[0].reference));
}

/// Frames before and after a loop scaled their keyframe, one of which was culled later: each is as far from
/// it as the final unit says.
TEST(ReplacementLog, FramesAreScaledWithTheirKeyframes) {
  GraphWriter writer;
  for (std::uint32_t k = 0; k < 2; ++k) {
    Keyframe keyframe;
    keyframe.id = KeyframeId{k};
    keyframe.T_k_w = SE3(SO3(), Vector3(-1.0 * k, 0, 0));
    writer.add_keyframe(keyframe);
  }
  ReplacementLog log;
  RecordSequence<FrameRecord> frames;
  const auto track = [&](std::uint64_t version) {
    FrameRecord frame;
    frame.state = FrameState::kTracked;
    frame.reference = KeyframeId{0};
    frame.snapshot_version = version;
    frame.T_c_ref = PackedPose(SE3(SO3(), Vector3(0, 0, 1)));
    frames.push_back(frame);
  };
  track(1);
  FrameRecord dropped;
  dropped.state = FrameState::kDropped;
  frames.push_back(dropped);
  log.add_scaling(2, {{KeyframeId{0}, 3}});
  track(2);
  writer.cull_keyframe(KeyframeId{0}, KeyframeId{1});  // one to the left of its replacement
  log.add(KeyframeId{0}, writer.graph());
  log.add_scaling(4, {{KeyframeId{1}, 2}});
  log.hang_on_live_keyframes(frames);
  for (const auto& [n, depth] : {std::pair{0, 6.0}, {2, 2.0}}) {
    const FrameRecord& frame = frames[static_cast<std::size_t>(n)];
    EXPECT_EQ(frame.reference, KeyframeId{1});
    EXPECT_LT((frame.T_c_ref.unpacked().translation() - Vector3(2, 0, depth)).norm(), 1e-12) << n;
  }
}

/// A library's run without an end: a loop every hundred versions, ten frames a version.
TEST(ReplacementLog, ScalesOlderThanTheFramesThatAreKeptAreForgotten) {
  constexpr std::size_t kFrames = 1000;
  constexpr std::uint32_t kKeyframes = 500;
  ReplacementLog log;
  log.keep_newest(kFrames);
  RecordSequence<FrameRecord> frames;
  frames.keep_newest(kFrames);
  std::vector<KeyframeScaling> scaling;
  for (std::uint32_t k = 0; k < kKeyframes; ++k) scaling.push_back({KeyframeId{k}, 2});
  std::size_t most = 0;
  for (std::uint64_t version = 1; version <= 100'000; ++version) {
    FrameRecord frame;
    frame.state = FrameState::kTracked;
    frame.reference = KeyframeId{0};
    frame.snapshot_version = version;
    frame.T_c_ref = PackedPose(SE3(SO3(), Vector3(0, 0, 1)));
    for (int n = 0; n < 10; ++n) frames.push_back(frame);
    if (version % 100 != 0) continue;
    log.add_scaling(version + 1, scaling);
    most = std::max(most, log.scales_in_memory());
  }
  EXPECT_LE(most, 60 * kKeyframes) << "of a thousand loops";
  log.hang_on_live_keyframes(frames);
  EXPECT_EQ(frames.back().T_c_ref.unpacked().translation().z(), 2) << "one loop since";
  EXPECT_EQ(frames.front().T_c_ref.unpacked().translation().z(), 4) << "two: that of version 99,901, too";
}

TEST(ReplacementLogDeathTest, TakesDownOnlyWhatTheMapStillKnows) {
  GraphWriter writer;
  for (std::uint32_t k = 0; k < 2; ++k) {
    Keyframe keyframe;
    keyframe.id = KeyframeId{k};
    writer.add_keyframe(keyframe);
  }
  ReplacementLog replacement_log;
  EXPECT_DEATH(replacement_log.add(KeyframeId{0}, writer.graph()), "culled");
  writer.cull_keyframe(KeyframeId{0}, KeyframeId{1});
  writer.forget_replacements(0);
  EXPECT_DEATH(replacement_log.add(KeyframeId{0}, writer.graph()), "culled");
}

}  // namespace
}  // namespace twofold
