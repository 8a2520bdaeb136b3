#include "io/files/trajectory_file.hpp"

#include <random>

#include <fmt/format.h>

#include "tests/io/scratch_folder.hpp"

namespace twofold {
namespace {

Trajectory random_trajectory(int count) {
  std::mt19937 rng(5);
  std::normal_distribution<double> normal;
  Trajectory trajectory;
  for (int i = 0; i < count; ++i) {
    Vector6 v;
    for (double& x : v) x = normal(rng);
    trajectory.push_back({1403715273262142976 + i * 33333333LL, SE3::exp(v)});
  }
  return trajectory;
}

TEST(TrajectoryFile, TumRoundTrip) {
  const ScratchFolder folder;
  const auto trajectory = random_trajectory(50);
  write_tum_trajectory(folder.path() / "t.txt", trajectory);
  const auto read = read_trajectory(folder.path() / "t.txt");
  ASSERT_EQ(read.size(), trajectory.size());
  for (std::size_t i = 0; i < read.size(); ++i) {
    EXPECT_EQ(read[i].t_ns, trajectory[i].t_ns);
    EXPECT_LT((read[i].T_w_c.inverse() * trajectory[i].T_w_c).log().norm(), 1e-8);
  }
}

/// The upper three rows of the matrix, a pose a line.
TEST(TrajectoryFile, KittiIsRead) {
  const ScratchFolder folder;
  const auto trajectory = random_trajectory(20);
  std::string text;
  for (const TimedPose& pose : trajectory) {
    const Matrix4 M = pose.T_w_c.matrix();
    for (int i = 0; i < 12; ++i) text += fmt::format("{:.9e}{}", M(i / 4, i % 4), i == 11 ? '\n' : ' ');
  }
  const auto read = read_trajectory(folder.write("t.txt", text));
  ASSERT_EQ(read.size(), trajectory.size());
  for (std::size_t i = 0; i < read.size(); ++i) {
    EXPECT_LT((read[i].T_w_c.inverse() * trajectory[i].T_w_c).log().norm(), 1e-7);
  }
}

TEST(TrajectoryFile, NamesFileLineAndProblem) {
  const ScratchFolder folder;
  const auto error = [&](const std::string& content) {
    return io_error_of([&] { (void)read_trajectory(folder.write("t.txt", content)); });
  };
  EXPECT_NE(error("1 0 0 0 0 0 0 1\n2 nan 0 0 0 0 0 1\n").find("t.txt:2: 'nan' is not a finite number"),
            std::string::npos);
  EXPECT_NE(error("2 0 0 0 0 0 0 1\n1 0 0 0 0 0 0 1\n").find("earlier than"), std::string::npos);
  EXPECT_NE(error("1 0 0 0 0 0 0 1\n1 0 0 0 0 0 0 1\n").find("the same as"), std::string::npos);
  EXPECT_NE(error("1 0 0 0 0 0 0 1\n1 5 0 0 0 0 0 1\n").find("the same as"), std::string::npos);
  EXPECT_NE(error("1 0 0 0 0 0 0 2\n").find("quaternion"), std::string::npos);
  EXPECT_NE(error("1 0 0 0 0 0 0 1\n2 0 0\n").find("t.txt:2: has 3 fields"), std::string::npos);
  EXPECT_NE(error("1 2 3\n").find("neither TUM"), std::string::npos);
  EXPECT_NE(error("# nothing\n").find("holds no poses"), std::string::npos);
  EXPECT_NE(error("1 0 0 0 0 2 0 0 0 0 1 0\n").find("not a rotation"), std::string::npos);
}

TEST(TrajectoryFile, IsReadAsWindowsAndSpreadsheetsWriteIt) {
  const ScratchFolder folder;
  const std::string mark = "\xef\xbb\xbf";
  const auto tum = read_trajectory(folder.write(
      "t.txt", mark + "timestamp tx ty tz qx qy qz qw\r\n1 0 0 0 0 0 0 1 \r\n2 1 0 0 0 0 0 1\t\r\n\r\n"));
  ASSERT_EQ(tum.size(), 2u);
  EXPECT_EQ(tum[1].T_w_c.translation().x(), 1);
  const auto euroc = read_trajectory(
      folder.write("e.csv", mark + "timestamp,p_x,p_y,p_z,q_w,q_x,q_y,q_z\r\n1000,0,0,0,1,0,0,0,\r\n"));
  ASSERT_EQ(euroc.size(), 1u);
  EXPECT_EQ(euroc[0].t_ns, 1000);
}

/// ORB-SLAM3's CameraTrajectory.txt of EuRoC.
TEST(TrajectoryFile, NanosecondsOfOurTimesAreKnown) {
  const ScratchFolder folder;
  const auto trajectory = read_trajectory(folder.write("t.txt",
                                                       "1403636579763555328.000000 0.1 0 0 0 0 0 1\n"
                                                       "1403636579813555456.000000 0.2 0 0 0 0 0 1\n"));
  ASSERT_EQ(trajectory.size(), 2u);
  EXPECT_EQ(trajectory[0].t_ns, 1403636579763555328);
  EXPECT_IO_ERROR(
      read_trajectory(folder.write("t.txt", "1403636579763.5 0.1 0 0 0 0 0 1\n")),
      "t.txt:1: '1403636579763.5' is not a time stamp in seconds: it is that large in milliseconds");
}

TEST(TrajectoryFile, KeepsTheFirstOfTwoPosesRoundedToOneStamp) {
  const ScratchFolder folder;
  const auto file =
      folder.write("t.txt", "1.1 0 0 0 0 0 0 1\n1.1 0.001 0 0 0 0 0 1\n1.2 0.002 0 0 0 0 0 1\n");
  const auto trajectory = read_tum_trajectory(file);
  ASSERT_EQ(trajectory.size(), 2u);
  EXPECT_EQ(trajectory[0].T_w_c.translation().x(), 0.0);
}

TEST(TrajectoryFile, SaysWhenItCannotWrite) {
  EXPECT_IO_ERROR(write_tum_trajectory("/nonexistent/t.txt", random_trajectory(1)), "cannot be written");
  if (!std::filesystem::exists("/dev/full")) GTEST_SKIP() << "no /dev/full here to stand for a full disk";
  EXPECT_IO_ERROR(write_tum_trajectory("/dev/full", random_trajectory(1)), "No space left");
}

}  // namespace
}  // namespace twofold
