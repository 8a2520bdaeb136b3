// One camera that moves far from frame to frame, or turns where it stands: near corners are then not where
// they can be followed to, and new ones have no depth.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <string>
#include <vector>

#include "io/sources/open_source.hpp"
#include "tests/engine/small_scene.hpp"
#include "tests/engine/whole_run.hpp"

namespace twofold {
namespace {

std::ptrdiff_t placed(const RunResult& result) {
  return std::count_if(result.frames.begin(), result.frames.end(),
                       [](const FrameRecord& record) { return has_final_pose(record); });
}

class WideSteps : public ::testing::TestWithParam<const char*> {};

TEST_P(WideSteps, OfACarDoNotKeepOneCameraFromStarting) {
  SourceOptions options;
  options.left_only = true;
  const auto source =
      open_source(std::string("synthetic:terrace?fps=4&frames=24&seed=") + GetParam(), options);
  const auto [result, path] = testing::run_whole(source->rig(), testing::frames_of(*source));
  EXPECT_GE(placed(result), 22);
  const auto evaluation =
      evaluate(associate(path, source->ground_truth(), 10'000'000), {.alignment = Alignment::kSim3});
  ASSERT_TRUE(evaluation);
  EXPECT_LT(evaluation->absolute.rmse, 0.01 * evaluation->path_length);
}
INSTANTIATE_TEST_SUITE_P(Seeds, WideSteps, ::testing::Values("1", "2", "3"));

/// Sideways, then a turn on the spot at 65 degrees a second, then sideways again.
SE3 turning_camera(int i) {
  constexpr int kTurns = 30, kGoesOn = 90;
  const double angle = 65.0 / 30 * std::numbers::pi / 180 * std::clamp(i - kTurns, 0, kGoesOn - kTurns);
  const SO3 R_w_c = SO3::exp(Vector3(0, angle, 0));
  const Vector3 before(0.02 * std::min(i, kTurns) - 0.3, 0.03 * std::sin(0.2 * std::min(i, kTurns)), 0);
  const Vector3 after = R_w_c * Vector3(0.02 * std::max(i - kGoesOn, 0), 0, 0);
  return SE3(R_w_c, before + after).inverse();
}

class TurningOnTheSpot : public ::testing::TestWithParam<std::uint32_t> {};

TEST_P(TurningOnTheSpot, IsFollowedByCornersWithoutDepth) {
  constexpr int kFrames = 130;
  Rig rig = testing::small_rig();
  rig.kind = SensorKind::kMono;
  std::vector<Frame> frames = testing::render_walk(turning_camera, 0, kFrames, GetParam());
  Trajectory truth;
  for (Frame& frame : frames) {
    frame.right.release();
    truth.push_back({frame.t_ns, turning_camera(static_cast<int>(frame.index)).inverse()});
  }
  const auto [result, path] = testing::run_whole(rig, [&, next = std::size_t{0}](Frame& frame) mutable {
    if (next == frames.size()) return FrameStatus::kEnd;
    frame = frames[next++];
    return FrameStatus::kFrame;
  });
  EXPECT_EQ(placed(result), kFrames);
  const auto evaluation = evaluate(associate(path, truth, 10'000'000), {.alignment = Alignment::kSim3});
  ASSERT_TRUE(evaluation);
  EXPECT_LT(evaluation->absolute.rmse, 0.05 * evaluation->path_length);
  // The camera moves again: what it sees by then gets a depth, and is a point of the map.
  EXPECT_GT(result.frames.back().inliers, 60);
}
INSTANTIATE_TEST_SUITE_P(Rooms, TurningOnTheSpot, ::testing::Values(1, 2, 3, 4));

}  // namespace
}  // namespace twofold
