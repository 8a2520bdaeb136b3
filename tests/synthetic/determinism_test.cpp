#include <gtest/gtest.h>
#include <tbb/global_control.h>

#include <cstring>
#include <opencv2/core.hpp>
#include <utility>

#include "synthetic/synthetic_sequence.hpp"

namespace twofold::synthetic {
namespace {

bool same_bytes(const cv::Mat& a, const cv::Mat& b) {
  if (a.size() != b.size() || a.type() != b.type()) return false;
  if (a.empty()) return true;
  return std::memcmp(a.data, b.data, a.total() * a.elemSize()) == 0;
}

bool same_bytes(const Frame& a, const Frame& b) {
  return a.index == b.index && a.t_ns == b.t_ns && same_bytes(a.left, b.left) &&
         same_bytes(a.right, b.right) && same_bytes(a.depth, b.depth);
}

SyntheticOptions small(const std::string& scene, SensorKind sensor) {
  SyntheticOptions options = default_options(scene);
  options.sensor = sensor;
  options.f *= 200.0 / options.width;
  options.width = 200;  // not a multiple of a tile
  options.height = 150;
  options.frames = 40;
  options.blur = 0.3;
  options.exposure = 0.3;
  options.object = true;
  options.drop = 0.2;
  return options;
}

/// Rows v of a frame at t are exposed at t + ((v + 0.5) / 40 - 0.5) 32 ms; the other camera takes an image
/// each millisecond.
TEST(RollingShutter, RowsAreExposedOneAfterTheOtherAboutTheFramesTime) {
  SyntheticOptions options = default_options("desk");
  options.sensor = SensorKind::kMono;
  options.f *= 320.0 / options.width;
  options.width = 320;
  options.height = 40;
  options.flight = 1;
  options.object = true;
  options.fps = 20;
  options.frames = 50;
  options.shutter = 0.032;
  options.readout = 0.031;
  const SyntheticSequence rolling(options);
  EXPECT_EQ(rolling.rig().readout, 0.031);
  options.fps = 1000;
  options.frames = 2100;
  options.shutter = 0;
  options.readout = std::nullopt;
  const SyntheticSequence global(options);
  EXPECT_EQ(global.rig().readout, std::nullopt);
  const auto differ = [&](int row, int frame) {
    return cv::norm(rolling.exact_view(40).intensity.row(row), global.exact_view(frame).intensity.row(row),
                    cv::NORM_L1) /
           options.width;
  };
  for (const auto& [row, ms] : {std::pair{12, -6}, {22, 2}, {27, 6}}) {
    EXPECT_LT(differ(row, 2000 + ms), 0.05) << row;
    EXPECT_GT(differ(row, 2000 - ms), 0.2) << row;
  }
  EXPECT_LT((rolling.T_w_c(40).inverse() * global.T_w_c(2000)).log().norm(), 1e-9);
}

class Determinism : public testing::TestWithParam<std::string> {};

/// The first and the last frame of both, by several threads and, in another order, by one.
void expect_same_bytes(const SyntheticSequence& one, const SyntheticSequence& two) {
  ASSERT_EQ(one.frame_count(), two.frame_count());
  const int last = one.frame_count() - 1;
  Frame threaded_last, threaded_first;
  {
    const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, 4);
    threaded_first = one.render(0);
    threaded_last = one.render(last);
  }
  const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, 1);
  EXPECT_TRUE(same_bytes(two.render(last), threaded_last));
  EXPECT_TRUE(same_bytes(two.render(0), threaded_first));
}

/// In one test, as making a place takes longer than all that is rendered here.
TEST_P(Determinism, SameSeedSameBytesOnAnyNumberOfThreadsAndAnotherSeedAnotherPlace) {
  SyntheticOptions options = small(GetParam(), SensorKind::kStereo);
  const SyntheticSequence one(options), two(options);
  expect_same_bytes(one, two);
  options.seed = 2;
  EXPECT_FALSE(same_bytes(SyntheticSequence(options).render(0).left, one.render(0).left));
  const SyntheticSequence with_depth(small(GetParam(), SensorKind::kRgbd));
  expect_same_bytes(with_depth, with_depth);
}

INSTANTIATE_TEST_SUITE_P(Scenes, Determinism, testing::ValuesIn(scene_names()));

}  // namespace
}  // namespace twofold::synthetic
