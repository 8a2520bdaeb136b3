// Frames as a tracker sees them once it has learnt what its cameras get wrong.
#include "tracking/fixed/image_correction.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <opencv2/core.hpp>

#include "imaging/image_buffers.hpp"
#include "synthetic/random.hpp"

namespace twofold {
namespace {

constexpr int kWidth = 240, kHeight = 176;
constexpr int kStepPx = 11;      // of the scene between two frames, to the left
constexpr int kDisparityPx = 8;  // all of it
const cv::Point kDeadLeft(100, 88), kDeadRight(130, 60);

class ImageCorrectionTest : public ::testing::Test {
 protected:
  static Rig rig_of(SensorKind kind) {
    Rig rig;
    rig.kind = kind;
    rig.camera = {200, 200, 119.5, 87.5, kWidth, kHeight};
    rig.baseline = 0.1;
    return rig;
  }
  /// Squares of 5 px, each of its own brightness, with a dead pixel.
  static cv::Mat image(int moved_px, const cv::Point& dead) {
    cv::Mat result(kHeight, kWidth, CV_8UC1);
    for (int v = 0; v < kHeight; ++v) {
      for (int u = 0; u < kWidth; ++u) {
        const auto square = static_cast<std::uint64_t>(v / 5 * 10'000 + (u + moved_px) / 5);
        result.at<std::uint8_t>(v, u) = static_cast<std::uint8_t>(20 + synthetic::mix64(square) % 200);
      }
    }
    result.at<std::uint8_t>(dead) = 255;
    return result;
  }
  static Frame frame(int i) {
    constexpr std::int64_t kInterval = 300'000'000;  // so long that all of each image is looked at
    Frame result{i, (i + 1) * kInterval, image(i * kStepPx, kDeadLeft), {}, {}};
    result.right = image(i * kStepPx + kDisparityPx, kDeadRight);
    result.depth = cv::Mat(kHeight, kWidth, CV_16UC1, cv::Scalar(1000 + i));
    return result;
  }
  /// The camera turns to the right so far that the scene moves by kStepPx, where the image's middle is.
  static SE3 turn() { return {SO3::exp(Vector3(0, -std::atan(kStepPx / 200.0), 0)), Vector3::Zero()}; }

  /// Images of the last of some frames.
  FrameImages after_frames(SensorKind kind, bool trusted) {
    constexpr int kSeen = 12;
    ImageCorrection correction(rig_of(kind), {}, {});
    FrameImages images;
    allocate_images(rig_of(kind), images);
    std::vector<double> inverse_depths(20, 0.5);
    for (int i = 0; i < kSeen; ++i) {
      correction.load(frame(i), images);
      correction.advance(turn());
      correction.learn(frame(i), trusted ? std::span(inverse_depths) : std::span<double>());
    }
    correction.load(frame(kSeen), images);
    return images;
  }
  static int at(const ImagePyramid& pyramid, const cv::Point& pixel) {
    return pyramid.level(0).at<std::uint8_t>(pixel);
  }
};

TEST_F(ImageCorrectionTest, RepairsDeadPixelsOfBothCameras) {
  const FrameImages images = after_frames(SensorKind::kStereo, true);
  EXPECT_LT(at(images.left, kDeadLeft), 230);
  EXPECT_LT(at(images.right, kDeadRight), 230);
}

TEST_F(ImageCorrectionTest, APoseInDoubtIsNoWitness) {
  const FrameImages images = after_frames(SensorKind::kStereo, false);
  EXPECT_EQ(at(images.left, kDeadLeft), 255);
  EXPECT_EQ(at(images.right, kDeadRight), 255);
}

TEST_F(ImageCorrectionTest, TakesTheImagesThatARigHas) {
  const FrameImages with_depth = after_frames(SensorKind::kRgbd, true);
  EXPECT_LT(at(with_depth.left, kDeadLeft), 230);
  EXPECT_EQ(with_depth.depth.at<std::uint16_t>(0, 0), 1012);
  const FrameImages one = after_frames(SensorKind::kMono, true);
  EXPECT_LT(at(one.left, kDeadLeft), 230);
  EXPECT_TRUE(one.depth.empty());
}

}  // namespace
}  // namespace twofold
