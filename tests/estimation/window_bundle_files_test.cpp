#include "fixtures/files/bundle_files.hpp"

#include <gtest/gtest.h>

#include <cstdlib>
#include <fstream>
#include <sstream>

#include "estimation/window_solver.hpp"

namespace twofold {
namespace {

class BundleFiles : public testing::Test {
 protected:
  BundleFiles() : folder_(std::filesystem::path(testing::TempDir()) / "twofold_bundle_files") {
    std::filesystem::remove_all(folder_);
    std::filesystem::create_directories(folder_);
  }
  ~BundleFiles() override { std::filesystem::remove_all(folder_); }
  std::filesystem::path write(const std::string& name, const std::string& text) {
    std::ofstream(folder_ / name) << text;
    return folder_ / name;
  }
  void expect_error(const std::string& text, const std::string& what) {
    const auto path = write("bad.txt", text);
    try {
      (void)read_bundle(path);
      ADD_FAILURE() << "no error, expected: " << what;
    } catch (const std::runtime_error& error) {
      EXPECT_EQ(error.what(), path.string() + what);
    }
  }
  std::filesystem::path folder_;
};

/// Camera looking along -z at points around (0, 0, -5), in the file's own model: p = -P / P.z,
/// f (1 + k1 |p|^2 + k2 |p|^4) p.
TEST_F(BundleFiles, ReadsBalWithDistortion) {
  const double f[2] = {500, 700}, k1[2] = {-0.1, 0.05}, k2[2] = {0.01, 0};
  const Vector3 t[2] = {{0, 0, 0}, {-1, 0.1, 0.2}}, w[2] = {{0, 0, 0}, {0.02, -0.1, 0.05}};
  const Vector3 points[3] = {{0.5, 0.2, -5}, {-1, 0.8, -6}, {0.3, -1, -4}};
  std::ostringstream text, parameters;
  text.precision(12);
  parameters.precision(12);
  text << "2 3 6\n";
  for (int k = 0; k < 3; ++k) {
    for (int i = 0; i < 2; ++i) {
      const Vector3 P = SE3(SO3::exp(w[i]), t[i]) * points[k];
      const Vector2 p = -P.head<2>() / P.z();
      const double r2 = p.squaredNorm();
      const Vector2 z = f[i] * (1 + r2 * (k1[i] + k2[i] * r2)) * p;
      text << i << ' ' << k << "     " << z.x() << ' ' << z.y() << '\n';
    }
  }
  for (int i = 0; i < 2; ++i) {
    for (const double value :
         {w[i].x(), w[i].y(), w[i].z(), t[i].x(), t[i].y(), t[i].z(), f[i], k1[i], k2[i]}) {
      parameters << value << '\n';
    }
  }
  for (const Vector3& p : points) parameters << p.x() << '\n' << p.y() << '\n' << p.z() << '\n';
  const WindowProblem problem = read_bundle(write("bal.txt", text.str() + parameters.str()));
  EXPECT_EQ(problem.poses.size(), 2u);
  EXPECT_EQ(problem.points.size(), 3u);
  EXPECT_EQ(problem.observations.size(), 6u);
  WindowSolverOptions options;
  options.huber_sigmas = 0;
  EXPECT_LT(window_cost(problem, options), 1e-6);  // floats: 3e-5 px each
}

TEST_F(BundleFiles, ReadsLibmvWithDistortion) {
  const auto path = write("libmv.txt",
                          "2 2 4\nP 500 320 240 0 0 0 0 0\n0 0 370 240\n1 0 270 240\n0 1 320 340\n1 1 "
                          "220 340\n0 0 0 0 0 0\n0 0 0 -1 0 0\n0.5 0 5\n0 1 5\n");
  const WindowProblem problem = read_bundle(path);
  WindowSolverOptions options;
  EXPECT_LT(window_cost(problem, options), 1e-8);
  // Barrel distortion pulls measurements inwards; freed from it they lie further out.
  const auto distorted =
      write("distorted.txt",
            "2 2 4\nP 500 320 240 -0.1 0 0 0 0\n0 0 370 240\n1 0 270 240\n0 1 320 340\n1 1 "
            "220 340\n0 0 0 0 0 0\n0 0 0 -1 0 0\n0.5 0 5\n0 1 5\n");
  EXPECT_GT(read_bundle(distorted).observations[0].pixel.x(), 370.04);
}

TEST_F(BundleFiles, ReadsStereoFolders) {
  write("VO_calibration.txt", "500 500 0.0 320 240 0.5\n");
  write("VO_camera_poses_large.txt",
        "1 1 0 0 0 0 1 0 0 0 0 1 0 0 0 0 1\n2 1 0 0 0 0 1 0 0 0 0 1 1 0 0 0 1\n");
  write("VO_stereo_factors_large.txt", "1 7 320 270 240 0 0 5\n2 7 320 257.5 240 0 0 4\n");
  const WindowProblem problem = read_bundle(folder_);
  ASSERT_EQ(problem.points.size(), 1u);
  EXPECT_LT(window_cost(problem, {}), 1e-8);
}

TEST_F(BundleFiles, NamesTheLineThatIsWrong) {
  expect_error("", ":0: file ends where header (cameras points observations) should stand");
  expect_error("2 3\n", ":1: header (cameras points observations) needs 3 fields, found 2");
  expect_error("1 1 1\n3 0 1 1\n", ":2: no camera 3");
  expect_error("1 1 1\n\n0 0 1 x\n", ":3: 'x' is not a number");
  expect_error("1 1 1\n0 0 1 1\n0\n0\n", ":4: file ends where camera parameter should stand");
  expect_error("1 1 1\n0 0 1 1\n0\n0\n0\n0\n0\n0\n-1\n0\n0\n", ":11: focal length must be positive");
  expect_error("1 1 1\nP 500 320 240 0 0 0 0\n", ":2: camera line needs 9 fields, found 8");
  expect_error("1 1 1\nP 500 320 240 0 0 0 0 0\n0 0 1 1\n0 0 0 0 0 0\n0 0 5\n", ": no point is seen twice");
}

/// Real tracks of a car: the cost of the published start falls to a minimum known from an independent solver.
TEST(BundleData, StereoTracksReachTheirMinimum) {
  const char* data = std::getenv("TWOFOLD_DATA");
  if (data == nullptr) GTEST_SKIP() << "TWOFOLD_DATA is not set";
  const auto folder = std::filesystem::path(data) / "tracks_gtsam_stereo_vo_large";
  if (!std::filesystem::exists(folder)) GTEST_SKIP() << folder << " is not there";
  WindowProblem problem = read_bundle(folder);
  WindowSolverOptions options;
  options.huber_sigmas = 0;
  options.max_iterations = 30;
  WindowSolver solver;
  const auto summary = solver.solve(problem, options);
  EXPECT_NEAR(summary.final_cost, 3154.046069, 0.003);  // Ceres 2.1, Euclidean points
}

}  // namespace
}  // namespace twofold
