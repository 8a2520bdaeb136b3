// A stereo pair whose calibration has slipped: rows of left and right images do not belong together any more.
#include <gtest/gtest.h>

#include <cstdio>

#include "imaging/row_offset.hpp"
#include "tests/engine/whole_run.hpp"

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
  const FrameFeed slipped = [&, frames = testing::frames_of(sequence)](Frame& frame) {
    const FrameStatus status = frames(frame);
    cv::Mat moved;
    if (status == FrameStatus::kFrame && frame.index >= from) take_back_row_offset(frame.right, -rows, moved);
    if (!moved.empty()) frame.right = moved;
    return status;
  };
  const auto [result, path] = testing::run_whole(sequence.rig(), slipped);
  for (const FrameRecord& record : result.frames) {
    EXPECT_EQ(record.state, FrameState::kTracked) << rows << ", frame " << record.frame_index;
  }
  const auto evaluation = evaluate(associate(path, testing::true_path(sequence), 1'000'000), {});
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
