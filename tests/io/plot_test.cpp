#include "io/plots/plot.hpp"

#include <gtest/gtest.h>

#include <cstring>
#include <opencv2/core.hpp>

#include "io/files/ply.hpp"
#include "io/plots/plot_ink.hpp"
#include "tests/io/scratch_folder.hpp"

namespace twofold {
namespace {

TEST(Plot, LooksAlongTheCamerasVertical) {
  const SE3 camera_world;                                                // y down
  const SE3 room(SO3::exp(Vector3(-1.5707963, 0, 0)), Vector3::Zero());  // camera level in a room with z up
  EXPECT_EQ(up_axis_of({{0, camera_world}}), 1);
  EXPECT_EQ(up_axis_of({{0, room}}), 2);
}

TEST(Plot, ATitleThatIsTooLongLosesItsMiddle) {
  const std::string path = "tum:" + std::string(200, 'a') + "/sequence?fx=585";
  PlotOptions options;
  options.title = path;
  PlotTrack track;
  track.x_w = {Vector3(0, 0, 0), Vector3(1, 0, 1)};
  const cv::Mat image = draw_top_down({track}, options);
  // The right margin of the title's rows stays white.
  const cv::Mat margin = image(cv::Rect(image.cols - 36, 0, 36, 40));
  EXPECT_EQ(cv::countNonZero(margin.reshape(1) < 250), 0);

  const std::string title = plot_ink::shortened(path, 0.7, 400);
  EXPECT_EQ(title.substr(0, 6), "tum:aa");
  EXPECT_EQ(title.substr(title.size() - 8), "e?fx=585");
  EXPECT_EQ(plot_ink::shortened("short", 0.7, 400), "short");
}

TEST(Plot, ALegendThatIsLongerThanAStraightRoadIsWideMakesRoomForItself) {
  PlotTrack track;
  track.x_w = {Vector3(0, 0, 0), Vector3(0, 0, 60)};
  const cv::Mat short_names = draw_top_down({track}, PlotOptions());
  track.name = std::string(60, 'm');
  const cv::Mat image = draw_top_down({track}, PlotOptions());
  EXPECT_GT(image.cols, short_names.cols + 100);
  // Behind "end", the last word, the legend's rows stay white.
  EXPECT_EQ(cv::countNonZero(image(cv::Rect(image.cols - 8, 60, 8, 24)).clone().reshape(1) < 250), 0);
}

TEST(Plot, DrawsEveryTrackAndCopesWithDegenerateOnes) {
  const cv::Scalar magenta(255, 0, 255);
  const auto count = [&](const std::vector<Vector3>& x) {
    const cv::Mat image = draw_top_down({{"a", x, magenta, 3, {}}, {"none", {}, magenta, 3, {}}}, {});
    cv::Mat mask;
    cv::inRange(image, cv::Scalar(200, 0, 200), cv::Scalar(255, 80, 255), mask);
    return cv::countNonZero(mask);
  };
  EXPECT_GT(count({{0, 0, 0}, {5, 5, 0}, {9, 0, 0}}), 1500);
  EXPECT_GT(count({{1, 1, 0}}), 50);
  EXPECT_GT(count({{0, 0, 0}, {0, 0, 0}}), 50);
}

TEST(Ply, WritesHeaderAndPoints) {
  const ScratchFolder folder;
  const PlyPoint points[] = {{Vector3(1, 2, 3), {10, 20, 30}, 0.5f}, {Vector3(-4, 0, 0), {}, 0}};
  write_ply(folder.path() / "m.ply", points);
  const std::string bytes = bytes_of(folder.path() / "m.ply");
  EXPECT_NE(bytes.find("element vertex 2\n"), std::string::npos);
  const auto body = bytes.find("end_header\n") + 11;
  ASSERT_EQ(bytes.size() - body, 2 * (24 + 3 + 4 + 8u));
  double xyz[3];
  std::memcpy(xyz, &bytes[body], sizeof(xyz));
  EXPECT_EQ(xyz[2], 3.0);
  EXPECT_EQ(bytes[body + 25], 20);
  EXPECT_IO_ERROR(write_ply("/nonexistent/m.ply", points), "cannot be written");
}

TEST(Ply, SaysTheUnitOfLength) {
  const ScratchFolder folder;
  const PlyPoint points[] = {{Vector3(1, 2, 3), {10, 20, 30}, 0.5f}};
  write_ply(folder.path() / "m.ply", points, LengthUnit::kArbitrary);
  EXPECT_EQ(bytes_of(folder.path() / "m.ply").find("metres"), std::string::npos);
  EXPECT_EQ(read_ply(folder.path() / "m.ply").size(), 1U);
}

TEST(Ply, ReadsFilesOfTheTimeBeforePointsHadFirstKeyframes) {
  const ScratchFolder folder;
  std::string bytes =
      "ply\nformat binary_little_endian 1.0\ncomment metres\nelement vertex 1\n"
      "property double x\nproperty double y\nproperty double z\n"
      "property uchar red\nproperty uchar green\nproperty uchar blue\nproperty float stddev\nend_header\n";
  bytes += std::string(24 + 3 + 4, '\0');
  folder.write("m.ply", bytes);
  const auto read = read_ply(folder.path() / "m.ply");
  ASSERT_EQ(read.size(), 1U);
  EXPECT_EQ(read[0].first_keyframe, PlyPoint::kUnknown);
}

TEST(Ply, ReadsWhatWasWrittenAndNothingElse) {
  const ScratchFolder folder;
  const PlyPoint points[] = {{Vector3(1, 2, 3), {10, 20, 30}, 0.5f, 7, 3}, {Vector3(-4, 0, 0), {}, 0}};
  write_ply(folder.path() / "m.ply", points);
  const auto read = read_ply(folder.path() / "m.ply");
  ASSERT_EQ(read.size(), 2U);
  EXPECT_EQ(read[0].x_w, points[0].x_w);
  EXPECT_EQ(read[0].rgb, points[0].rgb);
  EXPECT_EQ(read[0].stddev, 0.5F);
  EXPECT_EQ(read[0].first_keyframe, 7U);
  EXPECT_EQ(read[0].observers, 3U);
  EXPECT_EQ(read[1].x_w, points[1].x_w);
  EXPECT_EQ(read[1].first_keyframe, PlyPoint::kUnknown);
  std::filesystem::resize_file(folder.path() / "m.ply",
                               std::filesystem::file_size(folder.path() / "m.ply") - 1);
  EXPECT_IO_ERROR((void)read_ply(folder.path() / "m.ply"), "damaged");
  EXPECT_IO_ERROR((void)read_ply(folder.path() / "none.ply"), "cannot be opened");
}

}  // namespace
}  // namespace twofold
