#include "surface/meshing.hpp"

#include <gtest/gtest.h>

#include <map>
#include <set>

#include <Eigen/Geometry>

#include "surface/cube_triangles.hpp"
#include "tests/surface/ball_views.hpp"

namespace twofold {
namespace {

using testing::Ball;

using Side = std::pair<std::uint32_t, std::uint32_t>;

/// How often each side is walked along, by direction.
std::map<Side, int> sides_of(const TriangleMesh& mesh) {
  std::map<Side, int> sides;
  for (const auto& t : mesh.triangles)
    for (std::size_t i = 0; i < 3; ++i) ++sides[{t[i], t[(i + 1) % 3]}];
  return sides;
}

double enclosed_volume(const TriangleMesh& mesh) {
  double volume = 0;
  for (const auto& t : mesh.triangles)
    volume += mesh.positions[t[0]].cast<double>().dot(
                  mesh.positions[t[1]].cast<double>().cross(mesh.positions[t[2]].cast<double>())) /
              6;
  return volume;
}

TEST(CubeTriangles, UseEveryCrossedEdgeAndNoOther) {
  for (unsigned inside = 0; inside < 256; ++inside) {
    std::set<int> used, crossed;
    for (const auto& t : cube_triangles(inside)) used.insert(t.begin(), t.end());
    for (int e = 0; e < kCubeEdges; ++e) {
      const CubeEdge& edge = cube_edges()[static_cast<std::size_t>(e)];
      if ((inside >> edge.corner & 1U) != (inside >> edge.other() & 1U)) crossed.insert(e);
    }
    EXPECT_EQ(used, crossed) << inside;
  }
}

TEST(CubeTriangles, FaceOutwards) {
  // Corner 0 inside: the one triangle turns its back to it.
  const auto& triangles = cube_triangles(1);
  ASSERT_EQ(triangles.size(), 1u);
  std::array<Vector3, 3> p;
  for (std::size_t i = 0; i < 3; ++i) p[i] = 0.5 * Vector3::Unit(cube_edges()[triangles[0][i]].axis);
  EXPECT_GT((p[1] - p[0]).cross(p[2] - p[0]).dot(Vector3(1, 1, 1)), 0);
}

TEST(Meshing, BallSeenFromAllAroundIsClosed) {
  const Ball ball{{0.011, -0.007, 0.004}, 0.15};
  const TriangleMesh mesh = extract_mesh(testing::volume_of(ball));
  ASSERT_GT(mesh.triangles.size(), 1000u);
  for (const auto& [side, times] : sides_of(mesh)) {
    ASSERT_EQ(times, 1);
    ASSERT_EQ(sides_of(mesh).size() % 2, 0u);
    break;
  }
  const auto sides = sides_of(mesh);
  for (const auto& [side, times] : sides) {
    ASSERT_EQ(times, 1) << "two triangles walk along one side in one direction";
    ASSERT_TRUE(sides.count({side.second, side.first})) << "a hole";
  }
  const double volume = 4.0 / 3 * std::numbers::pi * std::pow(ball.radius, 3);
  EXPECT_NEAR(enclosed_volume(mesh), volume, 0.02 * volume);
}

TEST(Meshing, BallHasItsRadiusAndNormals) {
  const Ball ball{{0.011, -0.007, 0.004}, 0.15};
  const TriangleMesh mesh = extract_mesh(testing::volume_of(ball));
  double sum = 0;
  for (std::size_t v = 0; v < mesh.positions.size(); ++v) {
    const Vector3 from_centre = mesh.positions[v].cast<double>() - ball.centre;
    sum += std::abs(from_centre.norm() - ball.radius);
    EXPECT_GT(mesh.normals[v].cast<double>().dot(from_centre.normalized()), 0.9);
    EXPECT_GT(mesh.sigmas[v], 0);
  }
  EXPECT_LT(sum / static_cast<double>(mesh.positions.size()), 0.0015);
}

TEST(Meshing, SameVolumeSameBytes) {
  const Ball ball;
  EXPECT_EQ(extract_mesh(testing::volume_of(ball)), extract_mesh(testing::volume_of(ball)));
}

TEST(Meshing, SmallPiecesAreLeftOut) {
  TriangleMesh mesh;
  for (int i = 0; i < 8; ++i) mesh.positions.emplace_back(static_cast<float>(i), 0.0f, 0.0f);
  mesh.triangles = {{0, 1, 2}, {2, 3, 4}, {5, 6, 7}};
  EXPECT_EQ(drop_small_pieces(mesh, 2), 1u);
  EXPECT_EQ(mesh.triangles.size(), 2u);
  EXPECT_EQ(mesh.positions.size(), 5u);
}

/// A thing, its lid that hovers above it, and something of the background.
TEST(Meshing, PiecesBesideTheLargestOneAreLeftOut) {
  TriangleMesh mesh;
  const auto add_square = [&mesh](float x, float z, float half) {
    const auto first = static_cast<std::uint32_t>(mesh.positions.size());
    for (const float dx : {-half, half})
      for (const float dy : {-half, half}) mesh.positions.emplace_back(x + dx, dy, z);
    mesh.positions.emplace_back(x, 0.0f, z);
    for (const auto& [a, b] : {std::pair{0U, 1U}, {1U, 3U}, {3U, 2U}, {2U, 0U}})
      mesh.triangles.push_back({first + a, first + b, first + 4});
  };
  add_square(0, 0, 1);
  mesh.triangles.push_back({0, 1, 3});  // the largest
  add_square(0.3f, 5, 0.5f);
  add_square(3, 0, 1);
  EXPECT_EQ(drop_pieces_beside(mesh, Vector3::UnitZ()), 4u);
  EXPECT_EQ(mesh.triangles.size(), 9u);
  EXPECT_EQ(mesh.positions.size(), 10u);
  for (const auto& p : mesh.positions) EXPECT_LT(p.x(), 1.5f);
}

}  // namespace
}  // namespace twofold
