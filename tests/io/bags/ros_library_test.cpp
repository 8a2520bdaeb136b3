// Bags that ROS's own library wrote: scripts/test_bags.
#include <gtest/gtest.h>

#include <cstdlib>
#include <filesystem>
#include <string>

#include "io/sources/open_source.hpp"

namespace twofold {
namespace {

namespace fs = std::filesystem;

constexpr int kImages = 20;

void expect_stereo(const fs::path& file) {
  const auto source = open_source("bag:" + file.string() + "?fx=20&fy=20&cx=8&cy=4&baseline=0.1");
  EXPECT_EQ(source->rig().kind, SensorKind::kStereo);
  Frame frame;
  for (int i = 0; i < kImages; ++i) {
    ASSERT_EQ(source->next(frame), FrameStatus::kFrame) << source->error();
    EXPECT_EQ(frame.t_ns, i * 100'000'000LL);
    EXPECT_EQ(frame.left.at<unsigned char>(7, 15), i);
    EXPECT_EQ(frame.right.at<unsigned char>(0, 0), 100 + i);
  }
  EXPECT_EQ(source->next(frame), FrameStatus::kEnd);
  EXPECT_TRUE(source->report().faults.empty());
}

void expect_depth(const fs::path& file) {
  const auto source = open_source("bag:" + file.string());
  EXPECT_EQ(source->rig().kind, SensorKind::kRgbd);
  EXPECT_EQ(source->rig().camera.fx, 20);
  Frame frame;
  for (int i = 0; i < kImages; ++i) {
    ASSERT_EQ(source->next(frame), FrameStatus::kFrame) << source->error();
    EXPECT_EQ(frame.t_ns, i * 100'000'000LL);
    EXPECT_EQ(frame.left.at<unsigned char>(3, 3), 10 + i);
    EXPECT_EQ(frame.depth.at<std::uint16_t>(7, 15), 100 * i);
  }
  EXPECT_EQ(source->next(frame), FrameStatus::kEnd);
}

TEST(RosLibrary, WritesWhatIsReadHere) {
  const char* const folder = std::getenv("TWOFOLD_ROS_BAGS");
  if (folder == nullptr) GTEST_SKIP() << "TWOFOLD_ROS_BAGS is not set: scripts/test_bags writes the bags";
  int files = 0;
  for (const auto& entry : fs::directory_iterator(folder)) {
    SCOPED_TRACE(entry.path().filename().string());
    const bool depth = entry.path().filename().string().starts_with("depth");
    depth ? expect_depth(entry.path()) : expect_stereo(entry.path());
    ++files;
  }
  EXPECT_EQ(files, 7);
}

}  // namespace
}  // namespace twofold
