#include "twofold/surface.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <random>
#include <stdexcept>

#include "fixtures/option_rules.hpp"

namespace twofold {
namespace {

constexpr int kWidth = 160, kHeight = 120;

CameraRig depth_camera() {
  CameraRig rig;
  rig.sensor = Sensor::kRgbd;
  rig.width = kWidth;
  rig.height = kHeight;
  rig.fx = rig.fy = 130;
  rig.cx = 79.5;
  rig.cy = 59.5;
  rig.baseline = 0.08;
  return rig;
}

/// A wall 1.5 m before the camera, red.
struct WallFrame {
  std::vector<std::uint16_t> depth = std::vector<std::uint16_t>(kWidth * kHeight, 1500);
  std::vector<std::uint8_t> colour = std::vector<std::uint8_t>(3 * kWidth * kHeight, 20);
  WallFrame() {
    for (std::size_t i = 0; i < colour.size(); i += 3) colour[i] = 200;
  }
  [[nodiscard]] FrameView view() const {
    FrameView frame;
    frame.left = {colour.data(), kWidth, kHeight, 3 * kWidth, ImageFormat::kRgb8};
    frame.depth = {depth.data(), kWidth, kHeight, 2 * kWidth, ImageFormat::kDepth16};
    return frame;
  }
};

TEST(SurfaceModel, TellsWhatChangedInTheMesh) {
  const WallFrame wall;
  SurfaceModel model(depth_camera(), {.voxel_size = 0.02});
  EXPECT_EQ(model.mesh_changes(0).revision, 0U);
  ASSERT_GT(model.add(wall.view(), {}), 0);
  const SurfaceChanges first = model.mesh_changes(0);
  EXPECT_DOUBLE_EQ(first.cell_size, 0.16);
  std::size_t triangles = 0;
  for (const SurfacePiece& piece : first.pieces) triangles += piece.mesh.triangles.size();
  EXPECT_EQ(triangles, model.mesh().triangles.size());
  EXPECT_TRUE(model.mesh_changes(first.revision).pieces.empty());
  // Another part of the wall, 60 cells away.
  ASSERT_GT(model.add(wall.view(), {{0, 0, 0, 1}, {9.6, 0, 0}}), 0);
  const SurfaceChanges second = model.mesh_changes(first.revision);
  EXPECT_GT(second.revision, first.revision);
  EXPECT_EQ(second.pieces.size(), first.pieces.size());
  for (const SurfacePiece& piece : second.pieces) EXPECT_GT(piece.cell[0] * second.cell_size, 5);
  model.clear();
  for (const SurfacePiece& piece : model.mesh_changes(second.revision).pieces)
    EXPECT_TRUE(piece.mesh.triangles.empty());
}

TEST(SurfaceModel, TellsFreeFromOccupiedAndUnknown) {
  const WallFrame wall;
  SurfaceModel model(depth_camera(), {.voxel_size = 0.02});
  // The camera stands at x = 10 m in the world.
  const Pose T_world_camera{{0, 0, 0, 1}, {10, 0, 0}};
  for (int n = 0; n < 3; ++n) EXPECT_GT(model.add(wall.view(), T_world_camera), kWidth * kHeight / 2);
  const SpacePoint before = model.at({10, 0, 1.47});
  EXPECT_EQ(before.state, SpaceState::kFree);
  EXPECT_NEAR(before.distance, 0.03, 0.003);
  EXPECT_NEAR(before.gradient[2], -1, 0.05);
  const SpacePoint behind = model.at({10, 0, 1.53});
  EXPECT_EQ(behind.state, SpaceState::kOccupied);
  EXPECT_LT(behind.distance, 0);
  EXPECT_EQ(model.at({10, 0, 2.5}).state, SpaceState::kUnknown);
  EXPECT_EQ(model.at({0, 0, 1.5}).state, SpaceState::kUnknown);
  EXPECT_EQ(model.at({NAN, 0, 1.5}).state, SpaceState::kUnknown);
  EXPECT_EQ(model.at({1e300, 0, 1.5}).state, SpaceState::kUnknown);

  const SurfaceMesh mesh = model.mesh();
  ASSERT_GT(mesh.triangles.size(), 1000u);
  ASSERT_EQ(mesh.normals.size(), mesh.positions.size());
  for (std::size_t v = 0; v < mesh.positions.size(); ++v) {
    EXPECT_NEAR(mesh.positions[v][2], 1.5, 0.004);
    EXPECT_NEAR(mesh.colours[v][0], 200, 1);
    EXPECT_NEAR(mesh.colours[v][2], 20, 1);
  }
  model.clear();
  EXPECT_EQ(model.at({10, 0, 1.47}).state, SpaceState::kUnknown);
}

/// A pixel's 16 bits [mm].
void draw_box(WallFrame& wall, int left, int right, int top, int bottom, std::uint16_t depth) {
  for (int y = top; y < bottom; ++y)
    for (int x = left; x < right; ++x) wall.depth[static_cast<std::size_t>(y * kWidth + x)] = depth;
}

/// The wall is 3 m away.
WallFrame far_wall() {
  WallFrame wall;
  draw_box(wall, 0, kWidth, 0, kHeight, 3000);
  return wall;
}

TEST(SurfaceModel, KnowsTheFreeSpaceThatItSawThrough) {
  const WallFrame wall = far_wall();
  SurfaceModel model(depth_camera(), {.voxel_size = 0.02});
  const Pose T_world_camera{{0, 0, 0, 1}, {10, 0, 0}};
  ASSERT_GT(model.add(wall.view(), T_world_camera), 0);
  const SpacePoint before = model.at({10, 0, 2});
  EXPECT_EQ(before.state, SpaceState::kFree);
  EXPECT_DOUBLE_EQ(before.distance, 0.08);
  EXPECT_EQ(before.gradient, (std::array<double, 3>{0, 0, 0}));
  EXPECT_EQ(model.at({10.9, 0.4, 2}).state, SpaceState::kFree);
  // No gap between the truncation of the surface and the free space before it.
  for (double z = 0.8; z < 2.99; z += 0.003)
    EXPECT_EQ(model.at({10.1, 0.1, z}).state, SpaceState::kFree) << z;
  EXPECT_EQ(model.at({10, 0, 3.5}).state, SpaceState::kUnknown);  // behind the wall
  EXPECT_EQ(model.at({11.5, 0, 2}).state, SpaceState::kUnknown);  // beside the view
  EXPECT_EQ(model.at({10, 1.1, 2}).state, SpaceState::kUnknown);
  EXPECT_EQ(model.at({10, 0, -1}).state, SpaceState::kUnknown);  // behind the camera
  EXPECT_EQ(model.at({NAN, 0, 2}).state, SpaceState::kUnknown);
  EXPECT_EQ(model.at({1e300, 0, 2}).state, SpaceState::kUnknown);
  model.clear();
  EXPECT_EQ(model.at({10, 0, 2}).state, SpaceState::kUnknown);
}

TEST(SurfaceModel, KeepsFreeSpaceAsFarAsItIsTold) {
  const WallFrame wall = far_wall();
  SurfaceModel all(depth_camera(), {.voxel_size = 0.02});
  SurfaceModel near(depth_camera(), {.voxel_size = 0.02, .max_free_depth = 1.5});
  ASSERT_GT(all.add(wall.view(), {}), 0);
  ASSERT_GT(near.add(wall.view(), {}), 0);
  EXPECT_EQ(near.at({0, 0, 1.2}).state, SpaceState::kFree);
  EXPECT_EQ(near.at({0, 0, 1.7}).state, SpaceState::kUnknown);
  EXPECT_EQ(near.at({0, 0, 2.97}).state, SpaceState::kFree);  // of the surface
  EXPECT_LT(near.memory_bytes(), all.memory_bytes());
}

TEST(SurfaceModel, DoesNotSeeThroughAHoleInTheDepth) {
  WallFrame wall = far_wall();
  draw_box(wall, 78, 82, 58, 62, 0);
  SurfaceModel model(depth_camera(), {.voxel_size = 0.02});
  ASSERT_GT(model.add(wall.view(), {}), 0);
  EXPECT_EQ(model.at({0, 0, 2}).state, SpaceState::kUnknown);
  EXPECT_EQ(model.at({0.5, 0, 2}).state, SpaceState::kFree);
}

TEST(SurfaceModel, SeesNothingThroughAPillarThinnerThanACell) {
  WallFrame wall = far_wall();
  draw_box(wall, 79, 81, 0, kHeight, 1900);  // 3 cm wide
  SurfaceModel model(depth_camera(), {.voxel_size = 0.02});
  ASSERT_GT(model.add(wall.view(), {}), 0);
  EXPECT_NE(model.at({0.005, 0, 1.94}).state, SpaceState::kFree);
  EXPECT_NE(model.at({0.02, 0.3, 2.3}).state, SpaceState::kFree);
  EXPECT_EQ(model.at({0.5, 0, 1.94}).state, SpaceState::kFree);
  EXPECT_EQ(model.at({0, 0, 1.3}).state, SpaceState::kFree);
}

TEST(SurfaceModel, WhatComesToStandInFreeSpaceIsNotFreeInside) {
  WallFrame wall = far_wall();
  SurfaceModel model(depth_camera(), {.voxel_size = 0.02});
  for (int n = 0; n < 3; ++n) ASSERT_GT(model.add(wall.view(), {}), 0);
  EXPECT_EQ(model.at({0, 0, 1.55}).state, SpaceState::kFree);
  EXPECT_EQ(model.at({0, 0, 2.2}).state, SpaceState::kFree);
  draw_box(wall, 50, 110, 30, 90, 1500);
  for (int n = 0; n < 30; ++n) ASSERT_GT(model.add(wall.view(), {}), 0);
  // As far as the blocks of the wall, which stay as they were.
  for (double z = 1.52; z < 2.7; z += 0.01) EXPECT_NE(model.at({0, 0, z}).state, SpaceState::kFree) << z;
  EXPECT_EQ(model.at({0, 0, 1.3}).state, SpaceState::kFree);
  EXPECT_EQ(model.at({0.9, 0, 2.2}).state, SpaceState::kFree);  // beside the box
  // It is gone again.
  const WallFrame empty = far_wall();
  for (int n = 0; n < 30; ++n) ASSERT_GT(model.add(empty.view(), {}), 0);
  EXPECT_EQ(model.at({0, 0, 1.55}).state, SpaceState::kFree);
  EXPECT_EQ(model.at({0, 0, 2.2}).state, SpaceState::kFree);
}

TEST(SurfaceModel, KeepsTheNextRoomFreeBehindAWall) {
  const WallFrame wall = far_wall();
  SurfaceModel model(depth_camera(), {.voxel_size = 0.02});
  // From 4 m behind the wall, away from it; then the wall from this side.
  ASSERT_GT(model.add(wall.view(), {{0, 0, 0, 1}, {0, 0, 4}}), 0);
  EXPECT_EQ(model.at({0, 0, 6}).state, SpaceState::kFree);
  for (int n = 0; n < 3; ++n) ASSERT_GT(model.add(wall.view(), {}), 0);
  EXPECT_EQ(model.at({0, 0, 2}).state, SpaceState::kFree);
  EXPECT_EQ(model.at({0, 0, 6}).state, SpaceState::kFree);
}

/// A plane with texture before a pair.
struct PairFrame {
  explicit PairFrame(int disparity) : left(kWidth * kHeight), right(kWidth * kHeight) {
    std::mt19937 random(3);
    for (std::uint8_t& pixel : left) pixel = static_cast<std::uint8_t>(random() % 256);
    std::copy(left.begin() + disparity, left.end(), right.begin());
  }
  [[nodiscard]] FrameView view() const {
    FrameView frame;
    frame.left = {left.data(), kWidth, kHeight, kWidth, ImageFormat::kGrey8};
    frame.right = {right.data(), kWidth, kHeight, kWidth, ImageFormat::kGrey8};
    return frame;
  }
  std::vector<std::uint8_t> left, right;
};

/// Texture 0.65 m away: 16 pixels of disparity.
TEST(SurfaceModel, OfAPairEndsWhereTheRigSays) {
  CameraRig rig = depth_camera();
  rig.sensor = Sensor::kStereo;
  const PairFrame pair(16);
  const FrameView frame = pair.view();
  EXPECT_GT(SurfaceModel(rig).add(frame, {}), kWidth * kHeight / 4);
  rig.depth_max = 0.6;
  EXPECT_EQ(SurfaceModel(rig).add(frame, {}), 0);
  rig.depth_max = 8;
  rig.depth_min = 0.7;
  EXPECT_EQ(SurfaceModel(rig).add(frame, {}), 0);
  rig.depth_min = 9;
  EXPECT_THROW(SurfaceModel{rig}, std::invalid_argument);
  rig.depth_min = 0.3;
  ASSERT_NO_THROW(SurfaceModel{rig});
  rig.baseline = 0.1 / rig.fx;  // in another unit
  EXPECT_THROW(SurfaceModel{rig}, std::invalid_argument);
}

/// Texture 0.26 m away: 40 pixels of disparity, more than at 0.4 m.
TEST(SurfaceModel, OfAPairBeginsWhereTheRigSaysUnlessItIsToldOtherwise) {
  CameraRig rig = depth_camera();
  rig.sensor = Sensor::kStereo;
  rig.depth_min = 0.25;
  const PairFrame pair(40);
  EXPECT_GT(SurfaceModel(rig).add(pair.view(), {}), kWidth * kHeight / 4);
  EXPECT_LT(SurfaceModel(rig, {.min_stereo_depth = 0.4}).add(pair.view(), {}), kWidth * kHeight / 20);
}

TEST(SurfaceModel, KnowsNothingOfPositionsThatAreNoNumbers) {
  SurfaceModel model(depth_camera(), {.voxel_size = 0.02});
  for (int n = 0; n < 3; ++n) ASSERT_GT(model.add(far_wall().view(), {}), 0);
  const std::array<double, 3> free{0, 0, 1};
  ASSERT_EQ(model.at(free).state, SpaceState::kFree);
  for (const double none : {double{NAN}, double{INFINITY}, -1e300}) {
    for (std::size_t axis = 0; axis < 3; ++axis) {
      std::array<double, 3> position = free;
      position[axis] = none;
      EXPECT_EQ(model.at(position).state, SpaceState::kUnknown) << none << " along axis " << axis;
    }
  }
}

/// Before a wall 3 m away a box 1.5 m away; the camera looks past its side, along which `at` measures.
TEST(SurfaceModel, KnowsTheNearestSurfaceWhicheverWayItLies) {
  WallFrame frame = far_wall();
  draw_box(frame, 0, 80, 0, kHeight, 1500);
  SurfaceModel model(depth_camera(), {.voxel_size = 0.02});
  ASSERT_GT(model.add(frame.view(), {}), 0);
  const DistanceField field = model.distances({.min_corner = {-0.5, -0.4, 1.1},
                                               .max_corner = {0.5, 0.4, 3.05},
                                               .resolution = 0.04,
                                               .max_distance = 0.8,
                                               .unknown_is_obstacle = false});
  EXPECT_EQ(field.size, (std::array<std::int32_t, 3>{25, 20, 49}));
  ASSERT_EQ(field.distances.size(), 25U * 20U * 49U);
  ASSERT_EQ(field.states.size(), field.distances.size());
  const SpacePoint before_box = field.at({-0.3, 0, 1.2});
  EXPECT_EQ(before_box.state, SpaceState::kFree);
  EXPECT_NEAR(before_box.distance, 0.3, 0.02);
  EXPECT_NEAR(before_box.gradient[2], -1, 0.1);
  // Beside the rim of the box, to the right and farther away: up and to the right it is nearest.
  const SpacePoint beside = field.at({0.2, 0, 1.7});
  EXPECT_EQ(beside.state, SpaceState::kFree);
  EXPECT_NEAR(beside.distance, std::hypot(0.2, 0.2), 0.03);
  EXPECT_NEAR(beside.gradient[0], std::sqrt(0.5), 0.15);
  EXPECT_NEAR(beside.gradient[2], std::sqrt(0.5), 0.15);
  EXPECT_NEAR(field.at({0.3, 0, 2.9}).distance, 0.1, 0.02);       // of the wall
  EXPECT_NEAR(field.at({0.45, 0, 2.2}).distance, 0.8, 1e-6);      // as far as asked for
  EXPECT_EQ(field.at({-0.3, 0, 2}).state, SpaceState::kUnknown);  // behind the box
  EXPECT_NEAR(field.at({-0.3, 0, 1.53}).distance, -0.03, 0.02);
  EXPECT_EQ(field.at({0.6, 0, 2}).state, SpaceState::kUnknown);  // outside
  EXPECT_EQ(field.at({0.6, 0, 2}).distance, 0);
  EXPECT_EQ(field.at({NAN, 0, 2}).state, SpaceState::kUnknown);
}

/// What was never seen may hold anything: behind the rim of a box, for one.
TEST(SurfaceModel, TakesTheUnknownForAnObstacleUnlessItIsToldOtherwise) {
  WallFrame frame = far_wall();
  draw_box(frame, 0, 80, 0, kHeight, 1500);
  SurfaceModel model(depth_camera(), {.voxel_size = 0.02});
  ASSERT_GT(model.add(frame.view(), {}), 0);
  DistanceBox box{.min_corner = {-0.2, -0.2, 1.8},
                  .max_corner = {0.6, 0.2, 2.6},
                  .resolution = 0.04,
                  .max_distance = 0.5};
  const std::array<double, 3> beside{0.3, 0, 2.2};
  const SpacePoint point = model.distances(box).at(beside);
  EXPECT_EQ(point.state, SpaceState::kFree);
  EXPECT_LT(point.distance, 0.3);  // behind the box, on its left
  EXPECT_GT(point.distance, 0.1);
  EXPECT_GT(point.gradient[0], 0.5);
  const std::array<double, 3> hidden{-0.1, 0, 2.2};
  EXPECT_EQ(model.distances(box).at(hidden).state, SpaceState::kUnknown);
  EXPECT_LT(model.distances(box).at(hidden).distance, -0.05);
  EXPECT_GT(model.distances(box).at(hidden).gradient[0], 0.5) << "out to free space";
  box.unknown_is_obstacle = false;
  EXPECT_NEAR(model.distances(box).at(beside).distance, 0.5, 0.01);
  EXPECT_GT(model.distances(box).at(hidden).distance, 0.1);
}

/// Along the way into a thing whose front is `front` away, through its truncation band (8 cm) and beyond.
void expect_signed_distances(const SurfaceModel& model, double front) {
  DistanceBox box{.min_corner = {-0.1, -0.1, front - 0.5},
                  .max_corner = {0.1, 0.1, front + 0.4},
                  .resolution = 0.04,
                  .max_distance = 0.3};
  const DistanceField field = model.distances(box);
  for (double z = -0.4; z < 0.35; z += 0.02) {
    const SpacePoint point = field.at({0, 0, front + z});
    EXPECT_NEAR(point.distance, std::clamp(-z, -0.3, 0.3), 0.02) << z << " m behind the front";
    if (std::abs(z) < 0.02 || std::abs(z) > 0.24) continue;  // kinks at the surface's cell and at the end
    EXPECT_NEAR(point.gradient[2], -1, 0.2) << z << " m behind the front";
    if (z < 0) {
      EXPECT_EQ(point.state, SpaceState::kFree) << z;
    }
    if (z > 0 && z < 0.06) {
      EXPECT_EQ(point.state, SpaceState::kOccupied) << z;
    }
    if (z > 0.12) {
      EXPECT_EQ(point.state, SpaceState::kUnknown) << z;
    }
  }
  box.unknown_is_obstacle = false;
  const DistanceField surfaces = model.distances(box);
  EXPECT_NEAR(surfaces.at({0, 0, front - 0.2}).distance, 0.2, 0.02);
  EXPECT_NEAR(surfaces.at({0, 0, front + 0.04}).distance, -0.04, 0.02);
  EXPECT_NEAR(surfaces.at({0, 0, front + 0.2}).distance, 0.2, 0.02) << "unknown looks free";
  EXPECT_NEAR(surfaces.at({0, 0, front + 0.2}).gradient[2], 1, 0.2);
}

TEST(SurfaceModel, DistancesFallFromFreeSpaceDeepIntoAWall) {
  SurfaceModel model(depth_camera(), {.voxel_size = 0.02});
  for (int n = 0; n < 3; ++n) ASSERT_GT(model.add(far_wall().view(), {}), 0);
  expect_signed_distances(model, 3);
}

TEST(SurfaceModel, DistancesFallFromFreeSpaceDeepIntoAThickBox) {
  WallFrame frame = far_wall();
  draw_box(frame, 30, 130, 10, 110, 1500);
  SurfaceModel model(depth_camera(), {.voxel_size = 0.02});
  for (int n = 0; n < 3; ++n) ASSERT_GT(model.add(frame.view(), {}), 0);
  expect_signed_distances(model, 1.5);
}

TEST(SurfaceModel, SaysWhichBoxesHaveNoDistances) {
  const SurfaceModel model(depth_camera(), {.voxel_size = 0.02});
  const DistanceBox valid{.min_corner = {0, 0, 0}, .max_corner = {1, 1, 1}};
  EXPECT_EQ(valid.invalid_reason(), "");
  for (const float distance : model.distances(valid).distances) EXPECT_EQ(distance, -1);  // of nothing at all
  const DistanceBox optimistic{.max_corner = {1, 1, 1}, .unknown_is_obstacle = false};
  for (const float distance : model.distances(optimistic).distances) EXPECT_EQ(distance, 1);
  const auto refused = [&](DistanceBox box, const char* why) {
    EXPECT_NE(box.invalid_reason().find(why), std::string::npos) << box.invalid_reason();
    EXPECT_THROW(static_cast<void>(model.distances(box)), std::invalid_argument) << why;
  };
  refused({.max_corner = {1, 1, 0}}, "max_corner");
  refused({.min_corner = {0, NAN, 0}, .max_corner = {1, 1, 1}}, "min_corner");
  refused({.max_corner = {1, 1, 1e9}}, "max_corner");
  refused({.max_corner = {1, 1, 1}, .resolution = 0}, "resolution");
  refused({.max_corner = {1, 1, 1}, .max_distance = 0}, "max_distance");
  refused({.max_corner = {100, 100, 100}, .resolution = 0.01}, "cells");
}

TEST(SurfaceModel, OptionsSayWhyTheyAreInvalid) {
  testing::expect_rules<SurfaceModelOptions>(
      {{"voxel_size", [](auto& o) { o.voxel_size = 11; }},
       {"max_depth", [](auto& o) { o.max_depth = -1; }},
       {"max_free_depth", [](auto& o) { o.max_free_depth = -1; }},
       {"min_stereo_depth", [](auto& o) { o.min_stereo_depth = -1; }}});
}

TEST(SurfaceModel, RefusesWhatMakesNoSense) {
  EXPECT_THROW(SurfaceModel(depth_camera(), {.voxel_size = 0}), std::invalid_argument);
  EXPECT_THROW(SurfaceModel(depth_camera(), {.voxel_size = std::numeric_limits<double>::quiet_NaN()}),
               std::invalid_argument);
  EXPECT_THROW(SurfaceModel(depth_camera(), {.max_free_depth = -1}), std::invalid_argument);
  EXPECT_THROW(SurfaceModel{CameraRig()}, std::invalid_argument);
  SurfaceModel model(depth_camera(), {.voxel_size = 0.02});
  WallFrame wall;
  FrameView frame = wall.view();
  frame.depth.height = 60;
  EXPECT_THROW(model.add(frame, {}), std::invalid_argument);
  frame = wall.view();
  frame.depth.data = nullptr;
  EXPECT_THROW(model.add(frame, {}), std::invalid_argument);
  EXPECT_THROW(model.add(wall.view(), Pose{{0, 0, 0, 1}, {NAN, 0, 0}}), std::invalid_argument);
  EXPECT_THROW(model.add(wall.view(), Pose{{0, 0, 0, 1}, {1e9, 0, 0}}), std::invalid_argument);
  EXPECT_THROW(model.add(wall.view(), Pose{{0, 0, 0, 0}, {0, 0, 0}}), std::invalid_argument);
  EXPECT_THROW(model.add(wall.view(), Pose{{0, 0, 0, 2}, {0, 0, 0}}), std::invalid_argument);
  wall.depth.assign(wall.depth.size(), 0);
  EXPECT_EQ(model.add(wall.view(), {}), 0);
  EXPECT_EQ(model.memory_bytes(), 0u);
}

}  // namespace
}  // namespace twofold
