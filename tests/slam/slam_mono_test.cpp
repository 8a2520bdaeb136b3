#include <algorithm>

#include "tests/io/scratch_folder.hpp"
#include "tests/slam/slam_run.hpp"
#include "twofold/evaluation.hpp"

namespace twofold {
namespace {

/// The rig's left camera alone.
class SlamMonoTest : public testing::SlamRun {
 protected:
  static CameraRig left_camera() {
    CameraRig camera = rig();
    camera.sensor = Sensor::kMono;
    camera.baseline = 0;
    return camera;
  }
  static FrameView left_view(std::size_t i) {
    FrameView view = SlamRun::view(i);
    view.right = {};
    return view;
  }
  void push_all_left(Slam& slam) {
    slam.on_pose([&](const PoseEstimate& pose) { poses_.push_back(pose); });
    for (std::size_t i = 0; i < kFrames; ++i) {
      EXPECT_TRUE(slam.has_room() || slam.wait_for_room(60'000'000'000));
      const PushResult pushed = slam.push(left_view(i));
      EXPECT_TRUE(pushed) << pushed.reason;
    }
  }
  static TrajectoryError error_of(const SlamSummary& summary, AlignBy align) {
    std::vector<StampedPose> estimate, truth;
    for (const auto& pose : summary.poses) estimate.push_back({pose.t_ns, pose.T_world_camera});
    for (int i = 0; i < kFrames; ++i)
      truth.push_back({frames_->at(static_cast<std::size_t>(i)).t_ns, to_pose(T_c_w(i).inverse())});
    return compare(estimate, truth, {.align = align});
  }
  /// Of the points before the first keyframe, which the world begins at.
  static double median_depth_of(const MapSnapshot& map) {
    std::vector<double> depths;
    for (const MapSnapshot::Point& point : map.points(false))
      if (point.position[2] > 0) depths.push_back(point.position[2]);
    EXPECT_GT(depths.size(), 50);
    if (depths.empty()) return 0;
    const auto middle = depths.begin() + static_cast<std::ptrdiff_t>(depths.size() / 2);
    std::nth_element(depths.begin(), middle, depths.end());
    return *middle;
  }

  std::vector<PoseEstimate> poses_;
};

TEST_F(SlamMonoTest, IsPlacedOnceItHasMovedAndKnowsItsPathUpToScale) {
  Slam slam(left_camera(), deterministic());
  push_all_left(slam);
  const SlamSummary summary = slam.finish();
  EXPECT_EQ(poses_.front().state, TrackingState::kLost);
  EXPECT_STRNE(poses_.front().reason, "");
  EXPECT_EQ(poses_.back().state, TrackingState::kTracked);
  EXPECT_GT(summary.placed_later, 0);
  EXPECT_EQ(summary.placed_later + summary.tracked + summary.lost, kFrames);
  EXPECT_GT(summary.tracked, kFrames / 2);
  const TrajectoryError error = error_of(summary, AlignBy::kSimilarity);
  EXPECT_LT(error.ate_rmse, 0.02);
  EXPECT_NEAR(median_depth_of(slam.map()), 1, 0.25) << "its unit is the first map's median depth";
  EXPECT_GT(error.scale, 1.3) << "which here is farther away than a metre";
}

TEST_F(SlamMonoTest, InTheMapOfARigItsPosesAreInMetres) {
  const ScratchFolder folder;
  const auto file = folder.path() / "rig.tfm";
  {
    Slam mapping(rig(), deterministic());
    push_all(mapping);
    (void)mapping.finish();
    mapping.save_map(file);
  }
  for (const RunMode mode : {RunMode::kDeterministic, RunMode::kThreaded}) {
    Slam slam(left_camera(), {.mode = mode, .map = file, .localise_only = true});
    push_all_left(slam);
    const SlamSummary summary = slam.finish();
    EXPECT_GT(summary.tracked, kFrames / 2);
    EXPECT_LT(error_of(summary, AlignBy::kRigidMotion).ate_rmse, 0.02);
  }
  EXPECT_THROW(Slam(left_camera(), {.mode = RunMode::kDeterministic, .map = file}), std::exception)
      << "it cannot go on with a rig's map";
  CameraRig other_lens = left_camera();
  other_lens.fx *= 1.5;
  EXPECT_THROW(Slam(other_lens, {.mode = RunMode::kDeterministic, .map = file, .localise_only = true}),
               std::exception);
}

TEST_F(SlamMonoTest, TakesOneImageAFrame) {
  Slam slam(left_camera(), deterministic());
  const PushResult refused = slam.push(SlamRun::view(0));
  EXPECT_EQ(refused.status, PushStatus::kRefused);
  EXPECT_NE(refused.reason.find("left image only"), std::string::npos) << refused.reason;
  EXPECT_TRUE(slam.push(left_view(0)));
  (void)slam.finish();
}

}  // namespace
}  // namespace twofold
