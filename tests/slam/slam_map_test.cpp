#include <malloc.h>
#include <algorithm>
#include <cmath>
#include <filesystem>
#include <optional>
#include <set>

#include <unistd.h>

#include "tests/slam/slam_run.hpp"

namespace twofold {
namespace {

class SlamMapTest : public testing::SlamRun {
 protected:
  SlamMapTest()
      : file_(
            (std::filesystem::temp_directory_path() / ("slam_map_" + std::to_string(::getpid()) + ".tfm"))) {}
  ~SlamMapTest() override { std::filesystem::remove(file_); }

  std::filesystem::path file_;
};

TEST_F(SlamMapTest, TheMapHasItsKeyframesPointsEdgesAndWindows) {
  Slam slam(rig(), {.mode = RunMode::kDeterministic, .inner_window = 2, .outer_window = 2});
  push_all(slam);
  (void)slam.finish();
  const MapSnapshot map = slam.map();
  const auto keyframes = map.keyframes();
  ASSERT_GE(keyframes.size(), 3U);
  std::set<std::uint32_t> ids;
  for (const auto& keyframe : keyframes) {
    ids.insert(keyframe.id);
    EXPECT_EQ(keyframe.part, keyframes[0].id);
    EXPECT_GT(keyframe.points, 20U);
    EXPECT_TRUE(keyframe.has_place);
    EXPECT_FALSE(keyframe.loaded);
  }
  const auto in_window = [&](int window) {
    return std::count_if(keyframes.begin(), keyframes.end(),
                         [&](const auto& k) { return k.window == window; });
  };
  EXPECT_EQ(in_window(1), 2);
  EXPECT_LE(in_window(2), 2);
  EXPECT_GE(in_window(2), 1);
  EXPECT_TRUE(ids.contains(map.reference()));
  const auto edges = map.edges();
  EXPECT_GE(edges.size() + 1, keyframes.size()) << "the keyframes hang together";
  for (const auto& edge : edges) {
    EXPECT_LT(edge.from, edge.to);
    EXPECT_TRUE(ids.contains(edge.from) && ids.contains(edge.to));
  }
  ASSERT_EQ(map.parts().size(), 1U);
  EXPECT_EQ(map.parts()[0].keyframes, keyframes.size());
  EXPECT_GT(map.memory_bytes(), map.points(false).size() * 256);
}

/// Poses that were told early are asked of the final map.
TEST_F(SlamMapTest, ALaterVersionKnowsWhereEarlierFramesAre) {
  Slam slam(rig(), {.mode = RunMode::kDeterministic, .inner_window = 2, .outer_window = 2});
  std::vector<PoseEstimate> told;
  slam.on_pose([&](const PoseEstimate& pose) { told.push_back(pose); });
  push_all(slam);
  const SlamSummary summary = slam.finish();
  const MapSnapshot map = slam.map();
  ASSERT_EQ(told.size(), summary.poses.size());
  for (std::size_t n = 0; n < told.size(); ++n) {
    const auto pose = map.camera_pose(told[n]);
    ASSERT_TRUE(pose) << n;
    EXPECT_EQ(pose->map_part, summary.poses[n].map_part);
    for (int axis = 0; axis < 3; ++axis)
      EXPECT_NEAR(pose->T_world_camera.t[static_cast<std::size_t>(axis)],
                  summary.poses[n].T_world_camera.t[static_cast<std::size_t>(axis)], 1e-6)
          << n;
  }
  for (const auto& keyframe : map.keyframes())
    EXPECT_EQ(map.keyframe_pose(keyframe.id)->T_world_camera, keyframe.T_world_camera);
  EXPECT_FALSE(map.camera_pose(PoseEstimate{})) << "it was not tracked";
  EXPECT_FALSE(map.keyframe_pose(kNoId));
  EXPECT_FALSE(map.keyframe_pose(1'000'000)) << "the map does not have it yet";
  EXPECT_FALSE(MapSnapshot().camera_pose(told[0]));
}

TEST_F(SlamMapTest, CovariancesOfPointsGrowWithTheirDistance) {
  Slam slam(rig(), deterministic());
  push_all(slam);
  (void)slam.finish();
  std::vector<std::pair<double, double>> depth_and_deviation;
  for (const auto& point : slam.map().points()) {
    const double variance = point.covariance[0] + point.covariance[4] + point.covariance[8];
    ASSERT_GT(variance, 0);
    EXPECT_NEAR(point.covariance[1], point.covariance[3], 1e-9 * variance);
    depth_and_deviation.emplace_back(std::hypot(point.position[0], point.position[1], point.position[2]),
                                     std::sqrt(variance));
  }
  for (const auto& point : slam.map().points(false)) EXPECT_TRUE(std::isnan(point.covariance[0]));
  ASSERT_GT(depth_and_deviation.size(), 100U);
  std::sort(depth_and_deviation.begin(), depth_and_deviation.end());
  const auto mean_of = [&](auto member, std::size_t begin, std::size_t end) {
    double sum = 0;
    for (std::size_t i = begin; i < end; ++i) sum += depth_and_deviation[i].*member;
    return sum / static_cast<double>(end - begin);
  };
  const std::size_t third = depth_and_deviation.size() / 3;
  using Point = std::pair<double, double>;
  const double near = mean_of(&Point::second, 0, third);
  EXPECT_GT(mean_of(&Point::second, 2 * third, 3 * third), near);
  // Better than one pixel of disparity in a single frame: z^2 / (f b).
  const double z = mean_of(&Point::first, 0, third);
  EXPECT_LT(near, z * z / (rig().fx * rig().baseline));
}

TEST_F(SlamMapTest, AHeldMapStaysAsItWasAndIsCounted) {
  Slam slam(rig(), deterministic());
  push_all(slam, 0, 15);
  const MapSnapshot held = slam.map();
  const auto before = held.keyframes();
  const std::uint64_t version = held.version();
  push_all(slam, 15);
  (void)slam.finish();
  MapSnapshot newest = slam.map();
  EXPECT_GT(newest.version(), version);
  EXPECT_GT(newest.keyframes().size(), before.size());
  EXPECT_EQ(slam.held_maps().versions, 2U);
  EXPECT_EQ(slam.held_maps().oldest, version);
  newest = MapSnapshot();
  EXPECT_EQ(slam.held_maps().versions, 1U);
  const auto after = held.keyframes();
  ASSERT_EQ(after.size(), before.size());
  for (std::size_t k = 0; k < after.size(); ++k) EXPECT_EQ(after[k].T_world_camera, before[k].T_world_camera);
}

/// Bytes of the heap in use.
std::size_t heap_bytes() {
  const struct mallinfo2 info = ::mallinfo2();
  return info.uordblks + info.hblkhd;
}

bool heap_is_measured() {
  const std::size_t before = heap_bytes();
  const std::vector<char> block(1 << 20);
  return heap_bytes() >= before + block.size();
}

TEST_F(SlamMapTest, WhatAHeldMapKeepsIsAtMostWhatItSays) {
  if (!heap_is_measured()) GTEST_SKIP() << "a sanitizer has a heap of its own";
  std::optional<MapSnapshot> held, whole;
  {
    Slam slam(rig(), deterministic());
    push_all(slam, 0, 25);
    held = slam.map();
    push_all(slam, 25);
    (void)slam.finish();
    whole = slam.map();
  }
  const auto freed_by = [](std::optional<MapSnapshot>& map) {
    const std::size_t before = heap_bytes();
    map.reset();
    return before - heap_bytes();
  };
  const std::size_t held_says = held->memory_bytes(), whole_says = whole->memory_bytes();
  const std::size_t replaced = freed_by(held);  // beside the newest version
  EXPECT_GT(replaced, 0U);
  EXPECT_LE(replaced, held_says);
  const std::size_t all = freed_by(whole);  // the last version that there is: nothing is shared
  EXPECT_LE(all, whole_says);
  EXPECT_GT(2 * all, whole_says) << "generous, but of use";
}

TEST_F(SlamMapTest, ASnapshotOutlivesItsSlam) {
  MapSnapshot map;
  EXPECT_EQ(map.version(), 0U);
  EXPECT_TRUE(map.keyframes().empty() && map.points().empty() && map.edges().empty() && map.parts().empty());
  {
    Slam slam(rig(), {});
    push_all(slam, 0, 20);
    (void)slam.finish();
    map = slam.map();
  }
  const MapSnapshot copy = map;
  map = MapSnapshot();
  EXPECT_GT(copy.points().size(), 50U);
}

TEST_F(SlamMapTest, ACameraFindsItselfInASavedMap) {
  {
    Slam slam(rig(), deterministic());
    push_all(slam);
    (void)slam.finish();
    slam.save_map(file_);
  }
  std::vector<PoseEstimate> poses;
  std::vector<MapEvent> events;
  Slam slam(rig(), {.mode = RunMode::kDeterministic, .map = file_, .localise_only = true});
  const std::uint64_t loaded = slam.map().version();
  const std::size_t keyframes = slam.map().keyframes().size();
  EXPECT_GT(keyframes, 2U) << "the map is there before the first frame";
  slam.on_pose([&](const PoseEstimate& pose) { poses.push_back(pose); });
  slam.on_event([&](const MapEvent& event) { events.push_back(event); });
  push_all(slam);
  const SlamSummary summary = slam.finish();
  EXPECT_EQ(poses.front().state, TrackingState::kUnplaced);
  EXPECT_EQ(poses.back().state, TrackingState::kTracked);
  EXPECT_GT(summary.tracked, kFrames / 2);
  ASSERT_FALSE(events.empty());
  EXPECT_EQ(events[0].kind, MapEventKind::kRelocalisation);
  EXPECT_EQ(events[0].map_part_before, kNoId);
  EXPECT_EQ(slam.map().keyframes().size(), keyframes);
  for (const auto& keyframe : slam.map().keyframes()) EXPECT_TRUE(keyframe.loaded) << keyframe.id;
  EXPECT_GE(slam.map().version(), loaded);
  EXPECT_THROW(slam.save_map("/nowhere/at.all"), std::runtime_error);
}

/// The focal lengths and the principal point of a rig that was calibrated again, which move what is in the
/// image's corners by some pixels.
CameraRig calibrated_again(CameraRig rig, double px) {
  const double scale = 1 + 0.5 * px / std::hypot(rig.cx, rig.cy);
  rig.fx *= scale;
  rig.fy *= scale;
  rig.baseline /= scale;
  rig.cx += 0.4 * px;
  return rig;
}

TEST_F(SlamMapTest, ARigThatWasCalibratedAgainFindsItselfAndIsTold) {
  {
    Slam slam(rig(), deterministic());
    push_all(slam);
    EXPECT_TRUE(slam.finish().notes.empty());
    slam.save_map(file_);
  }
  for (const bool localise_only : {true, false}) {
    Slam slam(calibrated_again(rig(), 0.9),
              {.mode = RunMode::kDeterministic, .map = file_, .localise_only = localise_only});
    push_all(slam);
    const SlamSummary summary = slam.finish();
    EXPECT_GT(summary.tracked, kFrames / 2);
    EXPECT_EQ(slam.map().parts().size(), 1U) << "it found itself in the map that was loaded";
    ASSERT_EQ(summary.notes.size(), 1U);
    EXPECT_NE(summary.notes[0].find("focal length fx is"), std::string::npos) << summary.notes[0];
  }
  try {
    Slam slam(calibrated_again(rig(), 3), {.map = file_});
    FAIL();
  } catch (const std::runtime_error& error) {
    EXPECT_NE(std::string(error.what()).find("centre cx is"), std::string::npos) << error.what();
    EXPECT_NE(std::string(error.what()).find("accepted is 1"), std::string::npos) << error.what();
  }
}

class InitialPoseTest : public SlamMapTest {
 protected:
  InitialPoseTest() {
    Slam slam(rig(), deterministic());
    push_all(slam);
    poses_ = slam.finish().poses;
    slam.save_map(file_);
  }
  [[nodiscard]] SlamOptions options(const InitialPose& pose) const {
    return {.mode = RunMode::kDeterministic, .map = file_, .localise_only = true, .initial_pose = pose};
  }
  [[nodiscard]] InitialPose true_pose() const { return {poses_[0].T_world_camera, poses_[0].map_part}; }
  [[nodiscard]] std::string refusal(const InitialPose& pose) const {
    try {
      Slam slam(rig(), options(pose));
    } catch (const std::invalid_argument& error) {
      return error.what();
    }
    return "";
  }

  std::vector<SlamSummary::FinalPose> poses_;
};

TEST_F(InitialPoseTest, TheFirstFrameIsTrackedWhereTheCameraIsSaidToBe) {
  Slam slam(rig(), options(true_pose()));
  std::vector<MapEvent> events;
  slam.on_event([&](const MapEvent& event) { events.push_back(event); });
  push_all(slam, 0, 1);
  ASSERT_TRUE(slam.latest());
  EXPECT_EQ(slam.latest()->state, TrackingState::kTracked);
  EXPECT_EQ(slam.latest()->map_part, poses_[0].map_part);
  for (const std::size_t axis : {0U, 1U, 2U})
    EXPECT_NEAR(slam.latest()->T_world_camera.t[axis], poses_[0].T_world_camera.t[axis], 0.02);
  ASSERT_EQ(events.size(), 1U) << "it is in the map, as after any other way to find itself there";
  EXPECT_EQ(events[0].kind, MapEventKind::kRelocalisation);
  EXPECT_EQ(events[0].map_part, poses_[0].map_part);
  EXPECT_EQ(events[0].map_part_before, kNoId);
}

TEST_F(InitialPoseTest, AWrongOneIsNotBelievedAndTheCameraIsRecognised) {
  InitialPose behind = true_pose();
  behind.T_world_camera = compose(behind.T_world_camera, {{0, 1, 0, 0}, {0, 0, 0}});  // looks back
  Slam slam(rig(), options(behind));
  std::vector<PoseEstimate> poses;
  slam.on_pose([&](const PoseEstimate& pose) { poses.push_back(pose); });
  push_all(slam);
  (void)slam.finish();
  EXPECT_EQ(poses[0].state, TrackingState::kUnplaced);
  EXPECT_EQ(poses.back().state, TrackingState::kTracked);
  for (std::size_t n = 0; n < poses.size(); ++n) {
    if (poses[n].state != TrackingState::kTracked) continue;
    EXPECT_NEAR(poses[n].T_world_camera.t[2], poses_[n].T_world_camera.t[2], 0.03) << n;
  }
}

TEST_F(InitialPoseTest, OneThatMakesNoSenseIsRefused) {
  EXPECT_EQ(refusal(true_pose()), "");
  InitialPose pose = true_pose();
  pose.map_part = 7;
  EXPECT_NE(refusal(pose).find("initial_pose.map_part is 7"), std::string::npos);
  pose = true_pose();
  pose.position_sigma = -1;
  EXPECT_NE(refusal(pose).find("position_sigma must be in [0, 10], is -1"), std::string::npos)
      << refusal(pose);
  pose = true_pose();
  pose.angle_sigma = std::nan("");
  EXPECT_NE(refusal(pose).find("angle_sigma"), std::string::npos);
  pose = true_pose();
  pose.T_world_camera.q = {};
  EXPECT_NE(refusal(pose).find("T_world_camera"), std::string::npos);
  EXPECT_NE(SlamOptions{.initial_pose = true_pose()}.invalid_reason().find("needs options.map"),
            std::string::npos);
}

}  // namespace
}  // namespace twofold
