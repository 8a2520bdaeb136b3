#include "twofold/surface.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <stdexcept>

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
  SurfaceModel model(depth_camera(), {.voxel = 0.02});
  EXPECT_EQ(model.mesh_changes(0).revision, 0U);
  ASSERT_GT(model.add(wall.view(), {}), 0);
  const SurfaceChanges first = model.mesh_changes(0);
  EXPECT_DOUBLE_EQ(first.edge, 0.16);
  std::size_t triangles = 0;
  for (const SurfacePiece& piece : first.pieces) triangles += piece.mesh.triangles.size();
  EXPECT_EQ(triangles, model.mesh().triangles.size());
  EXPECT_TRUE(model.mesh_changes(first.revision).pieces.empty());
  // Another part of the wall, 60 cells away.
  ASSERT_GT(model.add(wall.view(), {{0, 0, 0, 1}, {9.6, 0, 0}}), 0);
  const SurfaceChanges second = model.mesh_changes(first.revision);
  EXPECT_GT(second.revision, first.revision);
  EXPECT_EQ(second.pieces.size(), first.pieces.size());
  for (const SurfacePiece& piece : second.pieces) EXPECT_GT(piece.cell[0] * second.edge, 5);
  model.clear();
  for (const SurfacePiece& piece : model.mesh_changes(second.revision).pieces)
    EXPECT_TRUE(piece.mesh.triangles.empty());
}

TEST(SurfaceModel, TellsFreeFromOccupiedAndUnknown) {
  const WallFrame wall;
  SurfaceModel model(depth_camera(), {.voxel = 0.02});
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

TEST(SurfaceModel, RefusesWhatMakesNoSense) {
  EXPECT_THROW(SurfaceModel(depth_camera(), {.voxel = 0}), std::invalid_argument);
  EXPECT_THROW(SurfaceModel(depth_camera(), {.voxel = std::numeric_limits<double>::quiet_NaN()}),
               std::invalid_argument);
  EXPECT_THROW(SurfaceModel{CameraRig()}, std::invalid_argument);
  SurfaceModel model(depth_camera(), {.voxel = 0.02});
  WallFrame wall;
  FrameView frame = wall.view();
  frame.depth.height = 60;
  EXPECT_THROW(model.add(frame, {}), std::invalid_argument);
  frame = wall.view();
  frame.depth.data = nullptr;
  EXPECT_THROW(model.add(frame, {}), std::invalid_argument);
  EXPECT_THROW(model.add(wall.view(), Pose{{0, 0, 0, 1}, {NAN, 0, 0}}), std::invalid_argument);
  EXPECT_THROW(model.add(wall.view(), Pose{{0, 0, 0, 1}, {1e9, 0, 0}}), std::invalid_argument);
  wall.depth.assign(wall.depth.size(), 0);
  EXPECT_EQ(model.add(wall.view(), {}), 0);
  EXPECT_EQ(model.memory_bytes(), 0u);
}

}  // namespace
}  // namespace twofold
