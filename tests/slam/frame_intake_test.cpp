#include "slam/frame_intake.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <limits>
#include <opencv2/imgproc.hpp>
#include <vector>

namespace twofold {
namespace {

constexpr int kWidth = 8, kHeight = 6;

Rig rig_of(SensorKind kind) {
  Rig rig;
  rig.kind = kind;
  rig.camera = {10, 10, 4, 3, kWidth, kHeight};
  rig.baseline = 0.1;
  return rig;
}

class FrameIntakeTest : public ::testing::Test {
 protected:
  FrameIntakeTest() : pixels_(3 * 16 * kHeight) {
    for (std::size_t i = 0; i < pixels_.size(); ++i) pixels_[i] = static_cast<std::uint8_t>(7 * i);
  }
  [[nodiscard]] ImageView image(ImageFormat format = ImageFormat::kGrey8, std::ptrdiff_t stride = 40) const {
    return {pixels_.data(), kWidth, kHeight, stride, format};
  }
  [[nodiscard]] FrameView stereo(std::int64_t t_ns = 1) const {
    return {t_ns, image(), image(), {}, nullptr};
  }

  static void expect_refused(const FrameIntake& intake, const FrameView& frame, const std::string& part) {
    const std::string reason = intake.refusal(frame);
    EXPECT_NE(reason.find(part), std::string::npos) << "reason: '" << reason << "'";
  }

  std::vector<std::uint8_t> pixels_;
};

TEST_F(FrameIntakeTest, SaysWhatIsWrongWithAnImage) {
  const FrameIntake intake(rig_of(SensorKind::kStereo));
  EXPECT_EQ(intake.refusal(stereo()), "");
  FrameView frame = stereo();
  frame.left.width = 9;
  expect_refused(intake, frame, "the left image is 9x6, the rig's are 8x6");
  frame = stereo();
  frame.right = {};
  expect_refused(intake, frame, "the right image is missing");
  frame = stereo();
  frame.right.format = ImageFormat::kDepth16;
  expect_refused(intake, frame, "the right image is depth16");
  frame = stereo();
  frame.left.stride = 7;
  expect_refused(intake, frame, "stride is 7 bytes, but a row takes 8");
  frame = stereo();
  frame.left.format = ImageFormat::kBgr8;
  frame.left.stride = 23;
  expect_refused(intake, frame, "stride is 23 bytes, but a row takes 24");
  frame = stereo();
  frame.right = image(ImageFormat::kBgr8);
  expect_refused(intake, frame, "the left image is grey8, the right one bgr8: both must be of one format");
}

TEST_F(FrameIntakeTest, RgbdNeedsDepth) {
  const FrameIntake intake(rig_of(SensorKind::kRgbd));
  FrameView frame{1, image(), {}, image(ImageFormat::kDepth16), nullptr};
  EXPECT_EQ(intake.refusal(frame), "");
  frame.depth.stride = 41;
  expect_refused(intake, frame, "the depth image's rows must begin at addresses divisible by 2");
  frame.depth.format = ImageFormat::kGrey8;
  expect_refused(intake, frame, "the depth image is grey8, but must be depth16 or depth32f");
  frame.depth = {};
  expect_refused(intake, frame, "the depth image is missing");
}

TEST_F(FrameIntakeTest, DepthInMetresIsRoundedToUnits) {
  Rig rig = rig_of(SensorKind::kRgbd);
  rig.depth_unit = 0.002;
  FrameIntake intake(rig);
  constexpr float kNan = std::numeric_limits<float>::quiet_NaN(),
                  kInfinity = std::numeric_limits<float>::infinity();
  std::vector<float> metres(std::size_t{kWidth} * kHeight, 1.0F);
  const std::vector<float> first = {0.5F, 0.5011F, 0, -1, kNan, kInfinity, 131.07F, 131.2F};
  std::copy(first.begin(), first.end(), metres.begin());
  const auto owner = std::make_shared<int>(1);
  FrameView frame{
      1, image(), {}, {metres.data(), kWidth, kHeight, 4 * kWidth, ImageFormat::kDepth32F}, owner};
  EXPECT_EQ(intake.refusal(frame), "");
  const cv::Mat depth = intake.take(frame).depth;
  ASSERT_EQ(depth.type(), CV_16UC1);
  const std::vector<std::uint16_t> row(depth.ptr<std::uint16_t>(0), depth.ptr<std::uint16_t>(0) + kWidth);
  EXPECT_EQ(row, (std::vector<std::uint16_t>{250, 251, 0, 0, 0, 0, 65535, 0}));
  EXPECT_EQ(depth.at<std::uint16_t>(1, 0), 500);
  frame.t_ns = 2;
  frame.depth.stride = 4 * kWidth - 2;
  expect_refused(intake, frame, "stride is 30 bytes, but a row takes 32");
  frame.depth.stride = 4 * kWidth + 2;
  expect_refused(intake, frame, "addresses divisible by 4");
}

TEST_F(FrameIntakeTest, TimeMustGrow) {
  FrameIntake intake(rig_of(SensorKind::kStereo));
  EXPECT_EQ(intake.take(stereo(5)).index, 0);
  expect_refused(intake, stereo(5), "time does not grow");
  expect_refused(intake, stereo(4), "time does not grow");
  EXPECT_EQ(intake.take(stereo(6)).index, 1) << "a frame that was refused has no number";
  intake.skip(stereo(7));
  expect_refused(intake, stereo(7), "time does not grow");
  EXPECT_EQ(intake.take(stereo(8)).index, 3);
}

TEST_F(FrameIntakeTest, CopiesPixelsThatNobodyKeeps) {
  FrameIntake intake(rig_of(SensorKind::kStereo));
  const Frame frame = intake.take(stereo());
  const std::uint8_t before = frame.left.at<std::uint8_t>(2, 3);
  EXPECT_EQ(before, pixels_[2 * 40 + 3]);
  pixels_.assign(pixels_.size(), 0);
  EXPECT_EQ(frame.left.at<std::uint8_t>(2, 3), before);
}

TEST_F(FrameIntakeTest, KeepsTheOwnerAsLongAsThePixelsAreUsed) {
  FrameIntake intake(rig_of(SensorKind::kRgbd));
  auto owner = std::make_shared<int>(1);
  const std::weak_ptr<int> watched = owner;
  FrameView view{1, image(), {}, image(ImageFormat::kDepth16), owner};
  Frame frame = intake.take(view);
  EXPECT_EQ(frame.left.data, pixels_.data());
  EXPECT_EQ(frame.depth.data, pixels_.data());
  EXPECT_EQ(frame.depth.step[0], 40U);
  owner.reset();
  view.owner.reset();
  EXPECT_FALSE(watched.expired());
  cv::Mat another = frame.left;
  frame = {};
  EXPECT_FALSE(watched.expired());
  another.release();
  EXPECT_TRUE(watched.expired());
}

TEST_F(FrameIntakeTest, ColourBecomesGrey) {
  FrameIntake intake(rig_of(SensorKind::kStereo));
  for (auto& pixel : pixels_) pixel = 0;
  for (int v = 0; v < kHeight; ++v) {
    for (int u = 0; u < kWidth; ++u)
      pixels_[static_cast<std::size_t>(40 * v + 3 * u)] = 200;  // first channel
  }
  const auto grey_of = [&](ImageFormat format, std::int64_t t_ns) {
    return intake.take({t_ns, image(format), image(format), {}, nullptr}).left.at<std::uint8_t>(1, 1);
  };
  EXPECT_EQ(grey_of(ImageFormat::kRgb8, 1), 60);  // 0.299 of red
  EXPECT_EQ(grey_of(ImageFormat::kBgr8, 2), 23);  // 0.114 of blue
}

}  // namespace
}  // namespace twofold
