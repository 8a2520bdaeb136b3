// Cameras that measure depth, where there is none to be had: beyond the reach of a depth camera, and with a
// hand over the right one of a pair. Corners without depth then become points as one camera's do.
#include <gtest/gtest.h>

#include <cstdio>
#include <map>

#include "tests/engine/whole_run.hpp"

namespace twofold {
namespace {

using synthetic::SyntheticOptions;
using synthetic::SyntheticSequence;

SyntheticOptions courtyard(SensorKind sensor) {
  SyntheticOptions scene;
  scene.scene = "courtyard";
  scene.sensor = sensor;
  scene.width = 320;
  scene.height = 240;
  scene.f = 210;
  scene.fps = 15;
  return scene;
}

struct Found {
  Trajectory path;   ///< of the map part that has most frames
  double ate = 1e9;  ///< of that [m]
};

Found found(const testing::WholeRun& run, const Trajectory& truth) {
  std::map<KeyframeId, Trajectory> parts;
  for (const FrameRecord& record : run.result.frames) {
    if (record.state == FrameState::kTracked)
      parts[record.part_causal].push_back({record.t_ns, record.T_c_w_causal.unpacked().inverse()});
  }
  Found found;
  for (const auto& [part, path] : parts) {
    if (path.size() > found.path.size()) found.path = path;
  }
  const auto evaluation = evaluate(associate(found.path, truth, 1'000'000), {});
  if (evaluation) found.ate = evaluation->absolute.rmse;
  std::printf("%zu frames of one part, ATE %.4f m\n", found.path.size(), found.ate);
  return found;
}

/// Hardly a corner is within reach: it starts by motion, and the depth of a strip of the ground says how far
/// that was. With corners that have a depth alone it ends soon.
TEST(MissingDepth, ADepthCameraGoesOnBeyondItsReach) {
  for (const std::uint64_t seed : {1, 2, 9, 12}) {
    SyntheticOptions scene = courtyard(SensorKind::kRgbd);
    scene.seed = seed;
    scene.depth_max = 3;
    scene.frames = 200;
    const SyntheticSequence sequence(scene);
    const Trajectory truth = testing::true_path(sequence);
    EngineOptions by_depth_alone;
    by_depth_alone.tracker.new_points.seeded_points = 0;
    by_depth_alone.tracker.new_points.crowded_below = 0;
    const Found without =
        found(testing::run_whole(sequence.rig(), testing::frames_of(sequence), by_depth_alone), truth);
    EXPECT_LT(without.path.size(), 80U) << "or this test says nothing";
    const Found with = found(testing::run_whole(sequence.rig(), testing::frames_of(sequence)), truth);
    EXPECT_GE(with.path.size(), 195U) << "seed " << seed;
    EXPECT_LT(with.ate, 0.06) << "seed " << seed;
  }
}

/// Open ground: most of what it sees is beyond eight metres. It did not start.
TEST(MissingDepth, ADepthCameraStartsWhereFewCornersAreWithinReach) {
  for (const std::uint64_t seed : {103, 106}) {
    SyntheticOptions scene = courtyard(SensorKind::kRgbd);
    scene.scene = "campus";
    scene.seed = seed;
    scene.depth_max = 8;
    scene.frames = 60;
    const SyntheticSequence sequence(scene);
    const Trajectory truth = testing::true_path(sequence);
    const Found result = found(testing::run_whole(sequence.rig(), testing::frames_of(sequence)), truth);
    EXPECT_EQ(result.path.size(), 60U) << "seed " << seed;
    EXPECT_LT(result.ate, 0.1) << "seed " << seed;
  }
}

TEST(MissingDepth, APairGoesOnWithAHandOverTheRightCamera) {
  constexpr int kCovered = 30;  // from this frame on
  SyntheticOptions scene = courtyard(SensorKind::kStereo);
  scene.frames = 120;
  const SyntheticSequence sequence(scene);
  const FrameFeed covered = [&sequence, next = 0](Frame& frame) mutable {
    if (next == sequence.frame_count()) return FrameStatus::kEnd;
    frame = sequence.render(next);
    if (next++ >= kCovered) frame.right = cv::Mat(frame.left.size(), CV_8UC1, cv::Scalar(9));
    return FrameStatus::kFrame;
  };
  const auto run = testing::run_whole(sequence.rig(), covered);
  const Found result = found(run, testing::true_path(sequence));
  EXPECT_EQ(result.path.size(), 120U);
  EXPECT_LT(result.ate, 0.05);
}

}  // namespace
}  // namespace twofold
