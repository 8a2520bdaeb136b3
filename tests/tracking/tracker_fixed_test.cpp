// What moves with the camera, and what the tracker makes of it.
#include <gtest/gtest.h>

#include <algorithm>
#include <cstdint>
#include <vector>

#include "synthetic/random.hpp"
#include "tests/tracking/tracked_sequence.hpp"

namespace twofold {
namespace {

using namespace testing;

constexpr int kRounds = 3;  // there and back
constexpr int kDead = 320;  // pixels, of 320 x 240

/// Each frame as `change` leaves it, the sequence played to its end and back.
template <class Change>
std::vector<Frame> there_and_back(SensorKind kind, const Change& change) {
  std::vector<Frame> played;
  for (int i = 0; i < kRounds * kFrames; ++i) {
    const int at = i / kFrames % 2 == 0 ? i % kFrames : kFrames - 1 - i % kFrames;
    Frame frame = frames(kind)[static_cast<std::size_t>(at)];
    frame.index = i;
    frame.t_ns = i * std::int64_t{33'000'000};
    frame.left = frame.left.clone();
    frame.right = frame.right.clone();
    frame.depth = frame.depth.clone();
    change(frame);
    played.push_back(frame);
  }
  return played;
}

std::vector<cv::Point> dead_pixels(const cv::Size& size, std::uint64_t camera) {
  std::vector<cv::Point> dead;
  for (std::uint64_t i = 0; i < std::uint64_t{kDead}; ++i) {
    const auto word = synthetic::mix64(synthetic::mix64(camera) + i);
    dead.emplace_back(8 + static_cast<int>(word % static_cast<std::uint64_t>(size.width - 16)),
                      8 + static_cast<int>((word >> 20) % static_cast<std::uint64_t>(size.height - 16)));
  }
  return dead;
}

void kill(cv::Mat& image, std::uint64_t camera) {
  if (image.empty()) return;
  for (const cv::Point& at : dead_pixels(image.size(), camera))
    image.at<std::uint8_t>(at) = (at.x + at.y) % 2 == 0 ? 0 : 255;
}

/// Squares in the lower fifth of the image, so near that the right camera sees them 40 px to the left.
void show_bonnet(Frame& frame) {
  const int top = frame.left.rows * 4 / 5;
  const auto paint = [&](cv::Mat& image, int shift) {
    for (int v = top; v < image.rows; ++v) {
      for (int u = 0; u < image.cols; ++u) {
        const auto square = static_cast<std::uint64_t>(v / 6 * 1000 + (u + shift) / 6);
        image.at<std::uint8_t>(v, u) = static_cast<std::uint8_t>(40 + synthetic::mix64(square) % 160);
      }
    }
  };
  paint(frame.left, 0);
  if (!frame.right.empty()) paint(frame.right, 40);
  if (!frame.depth.empty()) frame.depth.rowRange(top, frame.depth.rows).setTo(0);
}

struct Outcome {
  int missed = 0;    ///< points searched and not found, in the second half
  int tracked = 0;   ///< frames
  double error = 0;  ///< of the last pose [m]
  cv::Mat left;      ///< of the last keyframe
};

Outcome run(SensorKind kind, const std::vector<Frame>& played, bool enabled) {
  TrackerOptions options;
  options.fixed.enabled = enabled;
  Odometry odometry(test_rig(kind, 320, 240), options);
  Outcome outcome;
  for (const Frame& frame : played) {
    const TrackResult result = odometry.step(frame);
    EXPECT_EQ(odometry.allocations(), 0u);
    outcome.tracked += result.status == TrackStatus::kTracking;
    if (2 * frame.index >= kRounds * kFrames) outcome.missed += result.searched - result.matches;
    if (result.proposed) outcome.left = odometry.proposal().images.left.level(0).clone();
    const SE3 error = odometry.T_c_w(result) * true_T_c_w(kFrames - 1).inverse();
    outcome.error = error.translation().norm();
  }
  return outcome;
}

int count_dead(const cv::Mat& image, std::uint64_t camera) {
  const auto dead = dead_pixels(image.size(), camera);
  return static_cast<int>(std::count_if(dead.begin(), dead.end(), [&](const cv::Point& at) {
    return image.at<std::uint8_t>(at) == ((at.x + at.y) % 2 == 0 ? 0 : 255);
  }));
}

TEST(TrackerFixedPixels, DeadPixelsAreRepaired) {
  const auto played = there_and_back(SensorKind::kStereo, [](Frame& frame) {
    kill(frame.left, 1);
    kill(frame.right, 2);
  });
  const Outcome as_taken = run(SensorKind::kStereo, played, false);
  const Outcome repaired = run(SensorKind::kStereo, played, true);
  EXPECT_EQ(repaired.tracked, kRounds * kFrames);
  EXPECT_LT(repaired.error, 0.02);
  EXPECT_LT(repaired.missed, as_taken.missed);
  EXPECT_EQ(count_dead(as_taken.left, 1), kDead);
  EXPECT_LT(count_dead(repaired.left, 1), kDead / 10);
}

TEST(TrackerFixedPixels, OnABonnetFewPointsAreLookedFor) {
  const auto played = there_and_back(SensorKind::kStereo, show_bonnet);
  const Outcome as_taken = run(SensorKind::kStereo, played, false);
  const Outcome learnt = run(SensorKind::kStereo, played, true);
  EXPECT_EQ(learnt.tracked, kRounds * kFrames);
  EXPECT_LT(learnt.error, 0.02);
  EXPECT_LT(learnt.missed, 0.7 * as_taken.missed);
}

}  // namespace
}  // namespace twofold
