// One camera that lands, and takes off again: the unit of its map is the height that it started at, of which
// it comes as near as a few ten-thousandths.
#include <gtest/gtest.h>

#include <algorithm>

#include "io/sources/open_source.hpp"
#include "tests/engine/whole_run.hpp"

namespace twofold {
namespace {

/// The frames that see the ground from less than this height [m].
Trajectory below(const Trajectory& truth, double height) {
  double lowest = truth.front().T_w_c.translation().z();
  for (const TimedPose& pose : truth) lowest = std::min(lowest, pose.T_w_c.translation().z());
  Trajectory low;
  for (const TimedPose& pose : truth) {
    if (pose.T_w_c.translation().z() - lowest < height) low.push_back(pose);
  }
  return low;
}

TEST(OneCameraLanding, FromTwoHundredMetresToFiveCentimetresAndUpAgain) {
  const auto source = open_source("synthetic:landing?rounds=2");
  const auto [result, path] = testing::run_whole(source->rig(), testing::frames_of(*source));
  for (const FrameRecord& record : result.frames) {
    EXPECT_TRUE(has_final_pose(record)) << record.frame_index;
  }
  const Trajectory& truth = source->ground_truth();
  for (const double height : {1000.0, 10.0, 0.2}) {
    const auto evaluation =
        evaluate(associate(path, below(truth, height), 10'000'000), {.alignment = Alignment::kSim3});
    ASSERT_TRUE(evaluation) << height;
    EXPECT_LT(evaluation->absolute.rmse, 0.01 * evaluation->path_length) << height;
  }
}

}  // namespace
}  // namespace twofold
