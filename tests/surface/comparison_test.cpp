#include "surface/comparison.hpp"

#include <gtest/gtest.h>

#include "fixtures/option_rules.hpp"
#include "surface/triangle_grid.hpp"

namespace twofold {
namespace {

TriangleMesh square(float edge, float z) {
  TriangleMesh mesh;
  mesh.positions = {{0, 0, z}, {edge, 0, z}, {edge, edge, z}, {0, edge, z}};
  mesh.triangles = {{0, 1, 2}, {0, 2, 3}};
  return mesh;
}

TEST(TriangleGrid, DistancesAreThoseOfAllTriangles) {
  const TriangleMesh mesh = square(1, 0);
  const TriangleGrid grid(mesh, 0.1f);
  EXPECT_NEAR(grid.distance({0.3f, 0.4f, 0.03f}), 0.03, 1e-5);
  EXPECT_NEAR(grid.distance({-0.03f, 0.4f, 0.04f}), 0.05, 1e-5);
  EXPECT_NEAR(grid.distance({1.03f, 1.04f, 0}), 0.05, 1e-5);
  EXPECT_FLOAT_EQ(grid.distance({0.3f, 0.4f, 0.5f}), 0.1f);
}

TEST(SampleSurface, IsEven) {
  const auto samples = sample_surface(square(1, 0), 0.01f);
  EXPECT_NEAR(static_cast<double>(samples.size()), 10000, 2);
  int lower_left = 0;
  for (const auto& s : samples) lower_left += s.position.x() < 0.5f && s.position.y() < 0.5f;
  EXPECT_NEAR(lower_left, 2500, 60);
}

TEST(CompareSurfaces, ShiftAndHalfAreFound) {
  const TriangleMesh truth = square(1, 0);
  TriangleMesh half = square(1, 0.004f);
  half.positions[1].x() = half.positions[2].x() = 0.5f;
  const SurfaceComparison found = compare_surfaces(half, SE3(), truth, truth);
  EXPECT_NEAR(found.accuracy.mean, 0.004, 1e-5);
  EXPECT_NEAR(found.accuracy.near, 1, 1e-9);
  EXPECT_NEAR(found.completeness.near, 0.509, 0.005);  // and what is within reach of its rim
  EXPECT_NEAR(found.f_score, 2 * 0.509 / 1.509, 0.005);
  ASSERT_EQ(found.vertex_errors.size(), 4u);
  EXPECT_NEAR(found.vertex_errors[0], 0.004, 1e-5);
  const SE3 T_w_e(SO3(), Vector3(0, 0, -0.004));
  EXPECT_NEAR(compare_surfaces(half, T_w_e, truth, half).accuracy.mean, 0, 1e-5);
}

TEST(CompareSurfaces, OptionsSayWhyTheyAreInvalid) {
  testing::expect_rules<SurfaceComparisonOptions>(
      {{"threshold", [](auto& o) { o.threshold = 0; }}, {"spacing", [](auto& o) { o.spacing = -0.1; }}});
}

TEST(FitSurface, FindsTheRigidMotion) {
  TriangleMesh corner = square(1, 0);  // three walls that meet
  corner.positions.insert(corner.positions.end(), {{0, 0, 1}, {1, 0, 1}, {0, 1, 1}});
  corner.triangles.insert(corner.triangles.end(), {{0, 1, 5}, {0, 5, 4}, {0, 4, 6}, {0, 6, 3}});
  const SE3 T_w_e(SO3::exp(Vector3(0.02, -0.03, 0.05)), Vector3(0.04, -0.06, 0.05));
  TriangleMesh moved = corner;
  for (auto& x : moved.positions) x = (T_w_e.inverse() * Vector3(x.cast<double>())).cast<float>();
  const SE3 found = fit_surface(moved, SE3(), corner);
  EXPECT_LT((found * T_w_e.inverse()).log().norm(), 1e-4);
}

}  // namespace
}  // namespace twofold
