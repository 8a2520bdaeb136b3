#include "fixtures/files/window_problem_io.hpp"

#include <gtest/gtest.h>

#include <sstream>

#include "fixtures/synthetic_window.hpp"

namespace twofold {
namespace {

std::string text_of(const WindowProblem& problem) {
  std::ostringstream out;
  write_window_problem(out, problem);
  return out.str();
}

WindowProblem small_problem() {
  SyntheticWindowOptions options;
  options.inner = 4;
  options.outer = 2;
  options.missing_right = 0.5;
  options.pixel_noise = 1;
  options.start_pose_noise = 0.01;
  auto problem = make_synthetic_window(options).start;
  problem.poses[2].fixed = true;
  return problem;
}

TEST(WindowProblemIo, ReadsBackWhatItWrote) {
  const WindowProblem problem = small_problem();
  const std::string text = text_of(problem);
  std::istringstream in("# a comment\n\n" + text);
  const WindowProblem read = read_window_problem(in, "memory");
  EXPECT_EQ(read.poses.size(), problem.poses.size());
  EXPECT_EQ(read.points.size(), problem.points.size());
  EXPECT_EQ(read.observations.size(), problem.observations.size());
  ASSERT_GT(problem.constraints.size(), 0u);
  EXPECT_EQ(read.constraints.size(), problem.constraints.size());
  EXPECT_TRUE(read.poses[2].fixed);
  EXPECT_EQ(read.points[1].psi, problem.points[1].psi);
  EXPECT_NEAR(window_cost(read, {}), window_cost(problem, {}), 1e-12 * window_cost(problem, {}));
}

void expect_error(const std::string& text, const std::string& what) {
  std::istringstream in(text);
  try {
    (void)read_window_problem(in, "w.txt");
    ADD_FAILURE() << "no error, expected: " << what;
  } catch (const std::runtime_error& error) {
    EXPECT_EQ(error.what(), what);
  }
}

TEST(WindowProblemIo, NamesTheLineThatIsWrong) {
  expect_error("", "w.txt:0: file ends where twofold_window should stand");
  expect_error("bal 1\n", "w.txt:1: not a window problem");
  expect_error("twofold_window 2\n", "w.txt:1: unknown version");
  const std::string head = "twofold_window 1\nrig stereo 400 400 320 240 640 480 0.1\n";
  expect_error("twofold_window 1\nrig lidar 400 400 320 240 640 480 0.1\n",
               "w.txt:2: unknown sensor 'lidar'");
  expect_error("twofold_window 1\nrig stereo -4 400 320 240 640 480 0.1\n",
               "w.txt:2: focal lengths must be positive");
  expect_error(head + "poses x\n", "w.txt:3: 'x' is not a number");
  expect_error(head + "poses -1\n", "w.txt:3: count -1 is out of range");
  expect_error(head + "poses 1\n0 0 0 0 1 1 2\n", "w.txt:4: pose needs 8 fields, found 7");
  expect_error(head + "poses 1\n0 0 0 0 2 1 2 3\n", "w.txt:4: quaternion is not of unit length");
  expect_error(head + "poses 1\n0 0 0 0 1 1 2 3\npoints 1\n0 0 0 1 1\n",
               "w.txt:6: file ends where observation should stand");
  expect_error(head + "poses 1\n0 0 0 0 1 1 2 3\npoints 1\n5 0 0 1 0\nconstraints 0\n",
               "w.txt: point 0: anchor is no pose");
}

TEST(WindowProblemIo, NamesTheFileThatIsMissing) {
  try {
    (void)read_window_problem(std::filesystem::path("no/such/window.txt"));
    ADD_FAILURE();
  } catch (const std::runtime_error& error) {
    EXPECT_STREQ(error.what(), "no/such/window.txt: cannot be opened");
  }
}

}  // namespace
}  // namespace twofold
