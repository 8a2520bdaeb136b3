#include "io/sources/resampled_source.hpp"

#include <gtest/gtest.h>

#include <opencv2/core.hpp>

#include "io/files/io_error.hpp"
#include "io/sources/open_source.hpp"

namespace twofold {
namespace {

std::unique_ptr<FrameSource> desk(const std::string& keys) {
  return open_source("synthetic:desk?sensor=mono&noise=0&frames=2" + keys);
}

/// Of which nobody sees an image: the place that is made fastest.
std::unique_ptr<FrameSource> terrace(const std::string& keys) {
  return open_source("synthetic:terrace?sensor=mono&frames=2" + keys);
}

/// A camera of other resolution and lens sees, resampled, what the map's own would have seen of it.
TEST(ResampledSource, ShowsWhatTheOtherCameraWouldHaveSeen) {
  for (const char* keys : {"&width=640&height=480&f=420", "&width=240&height=180&f=157.5"}) {
    const auto like = desk("&width=320&height=240&f=210");
    ResampledSource resampled(desk(keys), like->rig().camera);
    const PinholeCamera &camera = resampled.rig().camera, &wanted = like->rig().camera;
    EXPECT_EQ(camera.width, wanted.width);
    EXPECT_EQ(camera.height, wanted.height);
    EXPECT_NEAR(camera.fx, wanted.fx, 1e-9);
    EXPECT_NEAR(camera.cx, wanted.cx, 1e-9);
    EXPECT_EQ(resampled.ground_truth().size(), like->ground_truth().size());
    Frame seen, direct;
    for (int i = 0; i < 2; ++i) {
      ASSERT_EQ(resampled.next(seen), FrameStatus::kFrame);
      ASSERT_EQ(like->next(direct), FrameStatus::kFrame);
      EXPECT_EQ(seen.t_ns, direct.t_ns);
      const double difference = cv::norm(seen.left, direct.left, cv::NORM_L1) / (320.0 * 240);
      EXPECT_LT(difference, 6) << keys;
      cv::Mat shifted = cv::Mat::zeros(direct.left.size(), CV_8UC1);
      direct.left.colRange(0, 319).copyTo(shifted.colRange(1, 320));
      EXPECT_GT(cv::norm(seen.left, shifted, cv::NORM_L1) / (320.0 * 240), 1.5 * difference) << keys;
    }
    EXPECT_EQ(resampled.next(seen), FrameStatus::kEnd);
  }
}

TEST(ResampledSource, KeepsTheWholeFieldOfView) {
  const PinholeCamera like{210, 210, 159.5, 119.5, 320, 240};
  const ResampledSource wide(terrace("&width=640&height=240&f=210"), like);
  EXPECT_EQ(wide.rig().camera.width, 640);
  EXPECT_NEAR(wide.rig().camera.cx, 319.5, 1e-9);
  const ResampledSource narrow(terrace("&width=320&height=240&f=420"), like);
  EXPECT_EQ(narrow.rig().camera.width, 160);
  EXPECT_NEAR(narrow.rig().camera.fx, 210, 1e-9);
}

TEST(ResampledSource, RefusesWhatHasTooLittleInIt) {
  const PinholeCamera like{210, 210, 159.5, 119.5, 320, 240};
  EXPECT_THROW(ResampledSource(terrace("&width=64&height=48&f=40"), like), IoError);
  EXPECT_THROW(ResampledSource(terrace("&width=64&height=48&f=300"), like), IoError);
}

}  // namespace
}  // namespace twofold
