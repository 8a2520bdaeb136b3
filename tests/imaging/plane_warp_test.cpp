// Plane-induced homographies and alignment through them  (SWF 4.1.2).
#include "imaging/plane_warp.hpp"

#include <gtest/gtest.h>

#include <random>

#include "fixtures/rendered_scene.hpp"

namespace twofold::testing {
namespace {

TEST(PlaneHomography, MapsPixelsOfThePlane) {
  const Rig rig = test_rig(SensorKind::kStereo);
  std::mt19937 random(3);
  std::normal_distribution<double> n(0, 1);
  for (int trial = 0; trial < 100; ++trial) {
    const SE3 T_v_r = SE3::exp(0.2 * Vector6::NullaryExpr([&] { return n(random); }));
    const Vector3 x_r(n(random), n(random), 5 + n(random));
    const Vector3 n_r = Vector3(0.3 * n(random), 0.3 * n(random), 1).normalized();
    const auto H = plane_homography(rig.camera, T_v_r, x_r, n_r);
    ASSERT_TRUE(H);
    const Vector3 along = n_r.cross(Vector3(n(random), n(random), n(random)));
    const Vector3 other_r = x_r + 0.5 * along;
    const Vector2 expected = rig.camera.project(T_v_r * other_r);
    EXPECT_LT((map_pixel(*H, rig.camera.project(other_r)) - expected).norm(), 1e-8 * (1 + expected.norm()));
  }
  EXPECT_FALSE(plane_homography(rig.camera, SE3(), Vector3(1, 0, 0), Vector3(0, 0, 1)));
}

TEST(PlaneHomography, JacobianIsTheCentralDifference) {
  Matrix3 H;
  H << 1.1, 0.1, 5, -0.05, 0.9, -3, 1e-4, -2e-4, 1.02;
  const Vector2 uv(300, 200);
  const Eigen::Matrix2d J = map_pixel_jacobian(H, uv);
  for (int i = 0; i < 2; ++i) {
    const Vector2 h = 1e-4 * Vector2::Unit(i);
    EXPECT_LT((J.col(i) - (map_pixel(H, uv + h) - map_pixel(H, uv - h)) / 2e-4).norm(), 1e-7);
  }
}

/// A camera approaches a wall, turning: warped patches find their places to a few hundredths of a pixel,
/// where square ones, matched without warp, do not.
TEST(AlignSurfacePatch, WarpBeatsSquarePatches) {
  const Rig rig = test_rig(SensorKind::kStereo, 320, 240);
  RenderedScene scene(rig, Vector3(4, 4, 3), 11);
  const SE3 T_r_w;
  const SE3 T_v_w(SO3::exp(Vector3(0.03, -0.05, 0.15)), Vector3(0.1, -0.05, -0.55));
  FrameImages reference, view;
  scene.render(T_r_w, 1.0, reference);
  scene.render(T_v_w, 1.0, view);
  const SE3 T_v_r = T_v_w * T_r_w.inverse();
  double warped = 0, square = 0;
  int count = 0, square_count = 0;
  std::mt19937 random(5);
  std::normal_distribution<double> n(0, 1);
  for (int v = 50; v <= 190; v += 20) {
    for (int u = 60; u <= 260; u += 20) {
      SurfacePatch patch;
      const Vector2 uv(u + 0.3, v - 0.2);
      ASSERT_TRUE(cut_surface_patch(reference.left.level(0), uv, patch));
      const Vector3 x_r = rig.camera.unproject(uv) * scene.depth(T_r_w, uv);
      const Vector2 expected = rig.camera.project(T_v_r * x_r);
      if (!rig.camera.contains(expected, 20)) continue;
      Matrix3 H = *plane_homography(rig.camera, T_v_r, x_r, Vector3::UnitZ());
      const Vector2 wrong(0.5 * n(random), 0.5 * n(random));  // of the prediction
      H.topRows<2>() += wrong * H.row(2);
      const auto found = align_surface_patch(patch, H, view.left, {});
      ASSERT_TRUE(found) << uv.transpose();
      warped += (found->uv - expected).squaredNorm();
      ++count;
      Matrix3 shift = Matrix3::Identity();
      shift.topRightCorner<2, 1>() = expected + wrong - uv;
      if (const auto plain = align_surface_patch(patch, shift, view.left, {})) {
        square += (plain->uv - expected).squaredNorm();
        ++square_count;
      }
    }
  }
  ASSERT_GT(count, 60);
  EXPECT_LT(std::sqrt(warped / count), 0.08);
  EXPECT_TRUE(square_count < count || square > 4 * warped);
}

TEST(AlignSurfacePatch, RefusesWhatItCannotSee) {
  const Rig rig = test_rig(SensorKind::kStereo, 320, 240);
  RenderedScene scene(rig, Vector3(4, 4, 3), 12);
  FrameImages images;
  scene.render(SE3(), 1.0, images);
  SurfacePatch patch;
  EXPECT_FALSE(cut_surface_patch(images.left.level(0), Vector2(3, 100), patch));
  ASSERT_TRUE(cut_surface_patch(images.left.level(0), Vector2(150, 100), patch));
  Matrix3 H = Matrix3::Identity();
  EXPECT_TRUE(align_surface_patch(patch, H, images.left, {}));
  H(0, 2) = 165;  // over the border
  EXPECT_FALSE(align_surface_patch(patch, H, images.left, {}));
  H = Matrix3::Identity();
  H(0, 0) = -1;  // seen from behind
  H(0, 2) = 300;
  EXPECT_FALSE(align_surface_patch(patch, H, images.left, {}));
}

/// Along the row only, in the right image.
TEST(AlignSurfacePatch, FindsTheDisparity) {
  const Rig rig = test_rig(SensorKind::kStereo, 320, 240);
  RenderedScene scene(rig, Vector3(4, 4, 3), 13);
  FrameImages images;
  scene.render(SE3(), 1.0, images);
  SurfaceAlignmentOptions options;
  options.along_row = true;
  double error = 0;
  int count = 0;
  for (int u = 80; u < 240; u += 12) {
    const Vector2 uv(u, 120);
    SurfacePatch patch;
    ASSERT_TRUE(cut_surface_patch(images.left.level(0), uv, patch));
    const double disparity = rig.disparity_from_depth(scene.depth(SE3(), uv));
    Matrix3 H = Matrix3::Identity();
    H(0, 2) = -disparity + 0.7;
    const auto found = align_surface_patch(patch, H, images.right, options);
    ASSERT_TRUE(found);
    EXPECT_EQ(found->uv.y(), uv.y());
    error += std::abs(found->uv.x() - (u - disparity));
    ++count;
  }
  EXPECT_LT(error / count, 0.08);
}

}  // namespace
}  // namespace twofold::testing
