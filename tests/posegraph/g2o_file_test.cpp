#include "fixtures/files/g2o_file.hpp"

#include <gtest/gtest.h>

#include <cstdlib>
#include <filesystem>

namespace twofold::bench {
namespace {

std::string error_of(std::string_view text) {
  try {
    (void)parse_g2o(text, "file");
  } catch (const std::runtime_error& e) {
    return e.what();
  }
  return "no error";
}

TEST(G2oFile, ReadsPlanarGraphsAndChainsMissingVertices) {
  const auto graph = std::get<PoseGraph<SE2>>(parse_g2o(
      "# comment\n\nEDGE_SE2 7 9 1 0 1.5707963267948966 4 0 0 4 0 100\nEDGE_SE2 9 12 2 0 0 1 0 0 1 0 1\n",
      "file"));
  ASSERT_EQ(graph.poses.size(), 3u);
  // Camera 12 stands at (1, 2) in camera 7's frame and looks along y.
  const SE2 X = graph.poses[2].inverse();
  EXPECT_NEAR(X.translation().x(), 1, 1e-12);
  EXPECT_NEAR(X.translation().y(), 2, 1e-12);
  EXPECT_NEAR(X.angle(), M_PI / 2, 1e-12);
  EXPECT_EQ(graph.constraints[0].information(2, 2), 100);
  EXPECT_NEAR(pose_graph_cost(graph, PoseGraphError::kComponents), 0, 1e-20);
}

TEST(G2oFile, ComponentCostIsG2oChi2) {
  // X_0 = I, X_1 = (1, 0, 0; I), measured (0.5, 0, 0; half a turn about z less 90 degrees).
  const auto graph = std::get<PoseGraph<SE3>>(parse_g2o(
      "VERTEX_SE3:QUAT 0 0 0 0 0 0 0 1\nVERTEX_SE3:QUAT 1 1 0 0 0 0 0 1\n"
      "EDGE_SE3:QUAT 0 1 0.5 0 0 0 0 0.70710678118 0.70710678118 2 0 0 0 0 0 2 0 0 0 0 2 0 0 0 8 0 0 8 0 8\n",
      "file"));
  // g2o: translation R_z^T (0.5, 0, 0), vector part of the inverse quarter turn: 2 * 0.25 + 8 * 0.5.
  EXPECT_NEAR(pose_graph_cost(graph, PoseGraphError::kComponents), 4.5, 1e-9);
}

TEST(G2oFile, NamesTheLineAndWhatIsWrongWithIt) {
  EXPECT_EQ(error_of("VERTEX_SE2 0 0 0 0\nVERTEX_SE2 1 0 x 0\n"), "file:2: 'x' is not a valid pose");
  EXPECT_EQ(error_of("EDGE_SE2 0 1 1 0 0 1 0 0 1 0\n"),
            "file:1: the line ends where the information entry should stand");
  EXPECT_EQ(error_of("EDGE_SE2 0 1 1 0 0 1 0 0 1 0 1 9\n"), "file:1: unexpected field '9'");
  EXPECT_EQ(error_of("\nEDGE_SE2 4 4 1 0 0 1 0 0 1 0 1\n"), "file:2: edge joins vertex 4 to itself");
  EXPECT_EQ(error_of("EDGE_SE2 0 1 1 0 0 1 0 0 -1 0 1\n"),
            "file:1: the information matrix is not positive semi-definite");
  EXPECT_EQ(error_of("VERTEX_SE2 0 0 0 0\nEDGE_SE2 0 1 1 0 0 1 0 0 1 0 1\n"),
            "file:2: edge names vertex 1, which is missing");
  EXPECT_EQ(error_of("VERTEX_SE2 0 0 0 0\nVERTEX_SE2 0 0 0 0\n"), "file:2: vertex 0 stands twice");
  EXPECT_EQ(error_of("VERTEX_SE3:QUAT 0 0 0 0 0 0 0 0\n"),
            "file:1: the quaternion has norm 0, should have 1");
  EXPECT_EQ(error_of("VERTEX_SE2 0 nan 0 0\n"), "file:1: pose is not finite");
  EXPECT_EQ(error_of("VERTEX_SE2 0 0 0 0\nVERTEX_SE3:QUAT 1 0 0 0 0 0 0 1\n"),
            "file:2: planar and spatial elements in one file");
  EXPECT_NE(error_of("VERTEX_XY 0 0 0\n").find("file:1: 'VERTEX_XY' is not supported"), std::string::npos);
  EXPECT_EQ(error_of("VERTEX_SE2 0 0 0 0\n"), "file: there are no edges in the file");
  EXPECT_EQ(error_of("EDGE_SE2 0 1 1 0 0 1 0 0 1 0 1\nEDGE_SE2 2 3 1 0 0 1 0 0 1 0 1\n"),
            "file: the file has no vertices, and its edges do not connect all poses");
}

TEST(G2oFile, MissingFile) {
  EXPECT_THROW((void)read_g2o("/nowhere/x.g2o.gz"), std::runtime_error);
}

/// Reference costs computed independently, see the data's README.
TEST(G2oFile, KnownGraphsReachTheirKnownCosts) {
  const char* data = std::getenv("TWOFOLD_DATA");
  if (data == nullptr) GTEST_SKIP() << "TWOFOLD_DATA is not set";
  const struct {
    const char* file;
    double initial, final;
  } graphs[] = {{"tinyGrid3D.g2o", 213.064, 6.7278816},
                {"smallGrid3D.g2o", 115958, 458.15378},
                {"sphere2500.g2o", 2.54781e6, 727.15147}};
  for (const auto& known : graphs) {
    const auto path = std::filesystem::path(data) / "posegraphs" / known.file;
    auto graph = std::get<PoseGraph<SE3>>(read_g2o(path.string()));
    PoseGraphSolver<SE3> solver;
    const auto summary = solver.solve(
        graph, {.error = PoseGraphError::kComponents, .chordal_start = true, .relative_decrease = 1e-8});
    EXPECT_NEAR(summary.initial_cost / known.initial, 1, 1e-5) << known.file;
    EXPECT_NEAR(summary.final_cost / known.final, 1, 1e-5) << known.file;
  }
}

}  // namespace
}  // namespace twofold::bench
