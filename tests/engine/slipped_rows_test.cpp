// A stereo pair whose calibration has slipped: rows of left and right images do not belong together any more.
#include <gtest/gtest.h>

#include <atomic>
#include <cstdio>

#include "engine/engine.hpp"
#include "evaluation/evaluation.hpp"
#include "imaging/row_offset.hpp"
#include "synthetic/synthetic_sequence.hpp"

namespace twofold {
namespace {

using synthetic::SyntheticOptions;
using synthetic::SyntheticSequence;

struct Walk {
  double ate = 0;         ///< [m]
  double row_offset = 0;  ///< [px] as reported
};

SyntheticOptions small_courtyard() {
  SyntheticOptions scene;
  scene.scene = "courtyard";
  scene.width = 320;
  scene.height = 240;
  scene.f = 210;
  scene.frames = 120;
  scene.fps = 15;
  scene.noise = 2;
  return scene;
}

/// @param rows  right images lie lower, from frame `from` on
Walk walk(double rows, int from = 0) {
  static const SyntheticSequence sequence(small_courtyard());
  Trajectory truth;
  for (int i = 0; i < sequence.frame_count(); ++i) truth.push_back({sequence.t_ns(i), sequence.T_w_c(i)});
  const FrameFeed feed = [&, next = 0](Frame& frame) mutable {
    if (next == sequence.frame_count()) return FeedStatus::kEnd;
    frame = sequence.render(next++);
    cv::Mat moved;
    if (frame.index >= from) take_back_row_offset(frame.right, -rows, moved);
    if (!moved.empty()) frame.right = moved;
    return FeedStatus::kFrame;
  };
  EngineOptions options;
  options.deterministic = true;
  std::atomic<bool> interrupted{false};
  const RunResult result = Engine(sequence.rig(), options).run(feed, interrupted);
  EXPECT_EQ(result.error, "");
  Trajectory estimate;
  for (const FrameRecord& record : result.frames) {
    EXPECT_EQ(record.state, FrameState::kTracked) << rows << ", frame " << record.frame_index;
    if (record.state == FrameState::kTracked)
      estimate.push_back({record.t_ns, final_T_c_w(record, result.graph).inverse()});
  }
  const auto evaluation = evaluate(associate(estimate, truth, 1'000'000), {});
  EXPECT_TRUE(evaluation);
  std::printf("%.1f rows from frame %d: ATE %.4f m, named as %.3f\n", rows, from,
              evaluation ? evaluation->absolute.rmse : -1, result.row_offset);
  return {evaluation ? evaluation->absolute.rmse : 1e9, result.row_offset};
}

TEST(SlippedRows, AreNamedAndTakenBack) {
  const Walk aligned = walk(0);
  EXPECT_EQ(aligned.row_offset, 0);
  for (const double rows : {-2.0, 1.0}) {
    const Walk slipped = walk(rows);
    EXPECT_NEAR(slipped.row_offset, rows, 0.13);
    EXPECT_LT(slipped.ate, 1.5 * aligned.ate) << rows;
  }
}

TEST(SlippedRows, NeedNotBeWhole) {
  EXPECT_NEAR(walk(1.5).row_offset, 1.5, 0.13);
}

TEST(SlippedRows, AreNoticedWhileTheyHappen) {
  EXPECT_NEAR(walk(2, 40).row_offset, 2, 0.26);
}

}  // namespace
}  // namespace twofold
