// What makes rendered places hard: people, plain walls, light that changes.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <opencv2/core.hpp>
#include <string>
#include <vector>

#include "synthetic/synthetic_sequence.hpp"

namespace twofold::synthetic {
namespace {

constexpr double kFps = 10;

SyntheticOptions small_walk(const std::string& scene) {
  SyntheticOptions options;
  options.scene = scene;
  options.width = 160;
  options.height = 120;
  options.f = 105;
  options.fps = kFps;
  options.frames = 400;
  options.noise = 0;
  return options;
}

cv::Mat sharpness(const cv::Mat& intensity) {
  return cv::abs(intensity.colRange(1, intensity.cols) - intensity.colRange(0, intensity.cols - 1));
}

/// Share of neighbouring pixels that hardly differ.
double flat_share(const cv::Mat& intensity) {
  const cv::Mat difference = sharpness(intensity);
  return static_cast<double>(cv::countNonZero(difference < 0.3)) / static_cast<double>(difference.total());
}

TEST(Walkers, OneWalksTwoMetresAheadForEightSeconds) {
  for (const char* scene : {"corridor", "courtyard"}) {
    SyntheticOptions options = small_walk(scene);
    const SyntheticSequence empty(options);
    options.walkers = 1;
    const SyntheticSequence walked(options);
    int near = 0;
    for (int i = 0; i < 200; i += 5) {
      const cv::Mat depth = walked.exact_view(i).inverse_depth;
      const cv::Mat without = empty.exact_view(i).inverse_depth;
      if (i < 30) {  // nobody yet
        EXPECT_EQ(cv::countNonZero(depth != without), 0) << scene << i;
      }
      double nearest = 0;
      cv::minMaxLoc(depth, nullptr, &nearest, nullptr, nullptr, depth > without);
      // Of a torso, its back, and arms that swing.
      near += nearest > 1 / 2.3 && nearest < 1 / 1.5 ? 1 : 0;
    }
    EXPECT_GE(near, 14) << scene;  // eight seconds, looked at twice a second
    EXPECT_LE(near, 24) << scene;
  }
}

TEST(Walkers, OthersComeTowardsTheCameraAndPass) {
  SyntheticOptions options = small_walk("courtyard");
  const SyntheticSequence empty(options);
  options.walkers = 2;
  const SyntheticSequence walked(options);
  std::vector<double> distances;
  for (int i = 80; i < 120; ++i) {  // the second one's turn: from 8 s on
    const cv::Mat depth = walked.exact_view(i).inverse_depth.colRange(0, 70);  // he passes on the left
    const cv::Mat without = empty.exact_view(i).inverse_depth.colRange(0, 70);
    double nearest = 0;
    cv::minMaxLoc(depth, nullptr, &nearest, nullptr, nullptr, depth > without);
    if (nearest > 0) distances.push_back(1 / nearest);
  }
  ASSERT_GT(distances.size(), 5U);
  EXPECT_LT(*std::min_element(distances.begin(), distances.end()), 1.3);
}

TEST(PlainWalls, LoseTheirShareOfTexture) {
  for (const char* scene : {"corridor", "courtyard"}) {
    SyntheticOptions options = small_walk(scene);
    const double painted = flat_share(SyntheticSequence(options).exact_view(40).intensity);
    options.plain = 0.5;
    const double half = flat_share(SyntheticSequence(options).exact_view(40).intensity);
    options.plain = 1;
    const double plain = flat_share(SyntheticSequence(options).exact_view(40).intensity);
    options.bare = true;
    const double bare = flat_share(SyntheticSequence(options).exact_view(40).intensity);
    EXPECT_GT(half, painted + 0.03) << scene;
    EXPECT_GT(plain, half + 0.03) << scene;
    EXPECT_GT(bare, plain + 0.1) << scene;
  }
}

TEST(Light, StepsByHalfAndByAllOfTheStopsAndFlickers) {
  SyntheticOptions options = small_walk("desk");
  options.width = 64;
  options.height = 48;
  const SyntheticSequence steady(options);
  options.exposure_steps = 2;
  const SyntheticSequence stepped(options);
  options.exposure_steps = 0;
  options.flicker = 0.3;
  const SyntheticSequence flickering(options);
  const auto gain = [&](const SyntheticSequence& sequence, int i) {
    return cv::mean(sequence.render(i).left)[0] / cv::mean(steady.render(i).left)[0];
  };
  EXPECT_NEAR(gain(stepped, 24), 1, 0.01);
  EXPECT_NEAR(gain(stepped, 26), 0.5, 0.01);
  EXPECT_NEAR(gain(stepped, 64), 0.5, 0.01);
  EXPECT_NEAR(gain(stepped, 66), 1, 0.01);
  EXPECT_NEAR(gain(stepped, 110), 0.25, 0.01);
  double darkest = 1, brightest = 0;
  for (int i = 0; i < 40; ++i) {
    darkest = std::min(darkest, gain(flickering, i));
    brightest = std::max(brightest, gain(flickering, i));
  }
  EXPECT_NEAR(darkest, 0.7, 0.02);
  EXPECT_NEAR(brightest, 1, 0.02);
}

}  // namespace
}  // namespace twofold::synthetic
