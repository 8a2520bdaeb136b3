#include "surface/free_space/free_space.hpp"

#include <gtest/gtest.h>

#include "tests/surface/ball_views.hpp"

namespace twofold {
namespace {

constexpr double kVoxel = 0.02;
constexpr double kCell = 4 * kVoxel;

/// A ball may stand before it.
DepthView view_of_wall(double metres, const testing::Ball& ball = {{0, 0, 100}, 0.1}) {
  const Rig rig = testing::depth_rig();
  cv::Mat depth;
  testing::depth_of(rig, SE3(), ball, metres).convertTo(depth, CV_16U, 1 / rig.depth_unit);
  return make_depth_view(rig, depth, {});
}

BlockPosition cell_at(const Vector3& x) {
  const Eigen::Vector3i at = (x / kCell).array().floor().cast<int>();
  return {at.x(), at.y(), at.z()};
}

/// Positions from the camera to behind the wall, at all sides.
template <class Visit>
void for_positions(const Visit& visit) {
  for (double z = 0.3; z < 3; z += 0.07)
    for (double x = -1.5; x < 1.5; x += 0.06)
      for (double y = -1.2; y < 1.2; y += 0.06) visit(Vector3(x, y, z));
}

TEST(FreeSpace, OfAnotherFrameIsFreeWhereThatWas) {
  const SurfaceOptions options = testing::fine_options(kVoxel);
  FreeSpace seen(options, 0);
  seen.add(view_of_wall(2), SE3());
  const SE3 on_grid(SO3(), {kCell * 3, -kCell * 5, kCell * 2});
  const SE3 turned(SO3::exp(Vector3(0.02, 0.3, -0.1)), {0.31, -0.2, 0.5});
  for (const SE3& T_w_v : {on_grid, turned}) {
    FreeSpace whole(options, 0);
    whole.add(seen, T_w_v);
    int was_free = 0, is_free = 0;
    for_positions([&](const Vector3& x_v) {
      const Vector3 x_w = T_w_v * x_v;
      const bool free = whole.contains(cell_at(x_w));
      was_free += seen.contains(cell_at(x_v));
      is_free += free;
      EXPECT_TRUE(!free || seen.contains(cell_at(x_v))) << x_v.transpose();
    });
    ASSERT_GT(was_free, 3000);
    EXPECT_GT(is_free, 0.7 * was_free);
  }
}

TEST(FreeSpace, OnTheGridNothingOfAnotherIsLost) {
  const SurfaceOptions options = testing::fine_options(kVoxel);
  FreeSpace seen(options, 0), whole(options, 0);
  seen.add(view_of_wall(2), SE3());
  const SE3 T_w_v(SO3(), {kCell * 3, -kCell * 5, kCell * 2});
  whole.add(seen, T_w_v);
  for_positions([&](const Vector3& x_v) {
    EXPECT_EQ(whole.contains(cell_at(T_w_v * x_v)), seen.contains(cell_at(x_v))) << x_v.transpose();
  });
}

TEST(FreeSpace, WhatHidesPartOfItIsNotAddedTo) {
  const SurfaceOptions options = testing::fine_options(kVoxel);
  FreeSpace seen(options, 0);
  seen.add(view_of_wall(3), SE3());
  const DepthView with_ball = view_of_wall(3, {{0, 0, 1.8}, 0.3});
  const BlockPosition behind = cell_at({0.01, 0.01, 2.3}), before = cell_at({0.01, 0.01, 1});
  ASSERT_TRUE(seen.contains(behind) && seen.contains(before));
  const FreeSpace all = seen;
  seen.forget_hidden(with_ball, SE3());
  EXPECT_FALSE(seen.contains(behind));
  EXPECT_TRUE(seen.contains(before));
  for_positions([&](const Vector3& x) {
    EXPECT_TRUE(all.contains(cell_at(x)) || !seen.contains(cell_at(x))) << x.transpose();
  });
  FreeSpace none(options, 0);
  none.forget_hidden(with_ball, SE3());
  EXPECT_FALSE(none.contains(before)) << "nothing becomes free";
}

}  // namespace
}  // namespace twofold
