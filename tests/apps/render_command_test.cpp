#include <gtest/gtest.h>

#include <cstdlib>
#include <opencv2/core.hpp>

#include <fmt/format.h>

#include "io/files/mesh_file.hpp"
#include "io/sources/open_source.hpp"
#include "tests/io/scratch_folder.hpp"

namespace twofold {
namespace {

int render(const std::string& source, const std::string& out) {
  const std::string command =
      fmt::format("'{}' render '{}' --out '{}' >/dev/null 2>&1", TWOFOLD_BINARY, source, out);
  return WEXITSTATUS(std::system(command.c_str()));
}

void expect_same_recording(FrameSource& rendered, FrameSource& read_back) {
  EXPECT_EQ(read_back.rig().kind, rendered.rig().kind);
  EXPECT_NEAR(read_back.rig().camera.fx, rendered.rig().camera.fx, 1e-9);
  EXPECT_NEAR(read_back.rig().camera.cx, rendered.rig().camera.cx, 1e-9);
  EXPECT_NEAR(read_back.rig().baseline, rendered.rig().baseline, 1e-9);
  EXPECT_NEAR(read_back.rig().depth_unit, rendered.rig().depth_unit, 1e-12);
  ASSERT_EQ(read_back.ground_truth().size(), rendered.ground_truth().size());
  for (std::size_t i = 0; i < rendered.ground_truth().size(); ++i) {
    const TimedPose& a = rendered.ground_truth()[i];
    const TimedPose& b = read_back.ground_truth()[i];
    EXPECT_EQ(a.t_ns, b.t_ns);
    EXPECT_LT((a.T_w_c.inverse() * b.T_w_c).log().norm(), 1e-7);
  }
  Frame a, b;
  while (rendered.next(a) == FrameStatus::kFrame) {
    ASSERT_EQ(read_back.next(b), FrameStatus::kFrame) << read_back.error();
    EXPECT_EQ(a.t_ns, b.t_ns);
    for (const auto& [x, y] : {std::pair{a.left, b.left}, {a.right, b.right}, {a.depth, b.depth}}) {
      ASSERT_EQ(x.size(), y.size());
      if (!x.empty()) {
        EXPECT_EQ(cv::countNonZero(x != y), 0);
      }
    }
  }
  EXPECT_EQ(read_back.next(b), FrameStatus::kEnd);
}

TEST(RenderCommand, StereoIsReadBackAsEuroc) {
  const ScratchFolder scratch;
  const std::string source = "synthetic:courtyard?width=160&height=120&frames=6&drop=0.3";
  ASSERT_EQ(render(source, scratch / "out"), 0);
  expect_same_recording(*open_source(source), *open_source("euroc:" + (scratch / "out")));
}

TEST(RenderCommand, SeenIsWhatTheAskedFramesShow) {
  const ScratchFolder scratch;
  const auto triangles_seen = [&](int every) {
    const std::string file = scratch / fmt::format("seen_{}.ply", every);
    const std::string command = fmt::format(
        "'{}' render 'synthetic:desk?width=160&height=120&frames=41&sensor=rgbd' --seen '{}' --seen-every {} "
        ">/dev/null 2>&1",
        TWOFOLD_BINARY, file, every);
    EXPECT_EQ(WEXITSTATUS(std::system(command.c_str())), 0);
    return read_ply_mesh(file).triangles.size();
  };
  const std::size_t of_one = triangles_seen(100), of_two = triangles_seen(40);
  EXPECT_GT(of_one, 1000U);
  EXPECT_GT(of_two, of_one);
}

TEST(RenderCommand, RgbdIsReadBackAsTum) {
  const ScratchFolder scratch;
  const std::string source = "synthetic:desk?width=160&height=120&frames=3&sensor=rgbd";
  ASSERT_EQ(render(source, scratch / "out"), 0);
  expect_same_recording(*open_source(source), *open_source("tum:" + (scratch / "out")));
  expect_same_recording(*open_source(source), *open_source(scratch / "out"));  // recognised as such
}

TEST(RenderCommand, BadInputEndsWithTwo) {
  const ScratchFolder scratch;
  EXPECT_EQ(render("synthetic:castle", scratch / "a"), 2);
  EXPECT_EQ(render("synthetic:desk?noise=x", scratch / "b"), 2);
  EXPECT_EQ(render(scratch / "nowhere", scratch / "c"), 2);
  scratch.write("file", "not a folder");
  EXPECT_EQ(render("synthetic:desk?frames=1&width=64&height=48", scratch / "file"), 2);
  ASSERT_EQ(render("synthetic:desk?frames=1&width=64&height=48", scratch / "d"), 0);
  EXPECT_EQ(render("synthetic:desk?frames=1&width=64&height=48", scratch / "d"), 2);  // never overwrites
}

}  // namespace
}  // namespace twofold
