#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <limits>
#include <set>
#include <stdexcept>
#include <thread>
#include <vector>

#include "fixtures/option_rules.hpp"
#include "tests/io/scratch_folder.hpp"
#include "twofold/evaluation.hpp"
#include "twofold/source.hpp"

namespace twofold {
namespace {

constexpr const char* kScene = "synthetic:desk?frames=5&sensor=rgbd&width=64&height=48";

TEST(PublicSource, GivesFramesThatOutliveIt) {
  FrameView first, frame;
  {
    Source source(kScene);
    EXPECT_EQ(source.rig().sensor, Sensor::kRgbd);
    EXPECT_EQ(source.frame_count(), 5);
    EXPECT_EQ(source.ground_truth().size(), 5U);
    EXPECT_FALSE(source.is_live());
    ASSERT_TRUE(source.next(first));
    EXPECT_EQ(first.left.width, source.rig().width);
    EXPECT_EQ(first.depth.format, ImageFormat::kDepth16);
    EXPECT_EQ(first.right.data, nullptr);
    EXPECT_EQ(first.t_ns, source.ground_truth()[0].t_ns);
    for (int i = 1; i < 5; ++i) ASSERT_TRUE(source.next(frame));
    EXPECT_GT(frame.t_ns, first.t_ns);
    EXPECT_FALSE(source.next(frame));
  }
  ASSERT_TRUE(first.owner);
  int bright = 0;
  for (int u = 0; u < first.left.width; ++u)
    bright += static_cast<const std::uint8_t*>(first.left.data)[u] > 0;
  EXPECT_GT(bright, 0);
}

TEST(PublicEvaluation, HasNoRelativeErrorWhereNoPosesAreASecondApart) {
  std::vector<StampedPose> poses(10);
  for (std::size_t i = 0; i < poses.size(); ++i) {
    poses[i].t_ns = static_cast<std::int64_t>(i) * 10'000'000;
    poses[i].T_world_camera.t = {0.1 * static_cast<double>(i * i), static_cast<double>(i), 0};
  }
  EXPECT_TRUE(std::isnan(compare(poses, poses).rpe_rmse));
  for (StampedPose& pose : poses) pose.t_ns *= 100;
  EXPECT_EQ(compare(poses, poses).rpe_rmse, 0);
}

TEST(PublicSource, StopsWhenAsked) {
  Source source(kScene);
  FrameView frame;
  ASSERT_TRUE(source.next(frame));
  source.stop();
  EXPECT_FALSE(source.next(frame));
}

TEST(PublicSource, ThreadsThatAskForFramesTakeTurns) {
  constexpr int kFrames = 60;
  Source source("synthetic:desk?frames=60&sensor=rgbd&width=64&height=48");
  std::array<std::vector<std::int64_t>, 4> taken;
  std::vector<std::thread> threads;
  for (auto& times : taken) {
    threads.emplace_back([&source, &times] {
      for (FrameView frame; source.next(frame);) times.push_back(frame.t_ns);
    });
  }
  for (std::thread& thread : threads) thread.join();
  std::set<std::int64_t> all;
  for (const auto& times : taken) {
    EXPECT_TRUE(std::is_sorted(times.begin(), times.end()));
    all.insert(times.begin(), times.end());
  }
  EXPECT_EQ(all.size(), static_cast<std::size_t>(kFrames));
}

TEST(PublicSource, SaysWhatIsWrong) {
  try {
    const Source source("euroc:/nowhere");
    FAIL();
  } catch (const std::runtime_error& error) {
    EXPECT_NE(std::string(error.what()).find("/nowhere"), std::string::npos) << error.what();
  }
}

TEST(PublicSource, GivesOneCameraAlone) {
  Source source("synthetic:courtyard?frames=2&width=160&height=120", {.left_only = true});
  EXPECT_EQ(source.rig().sensor, Sensor::kMono);
  FrameView frame;
  ASSERT_TRUE(source.next(frame));
  EXPECT_EQ(frame.left.width, 160);
  EXPECT_EQ(frame.right.data, nullptr);
  EXPECT_EQ(frame.depth.data, nullptr);
  EXPECT_EQ(Source("synthetic:courtyard?frames=2&width=160&height=120&sensor=mono").rig().sensor,
            Sensor::kMono);
}

std::vector<StampedPose> walk(double wobble) {
  std::vector<StampedPose> poses;
  for (int i = 0; i < 60; ++i) {
    const double s = 0.1 * i;
    const double off = i % 2 == 0 ? wobble : -wobble;
    poses.push_back({i * 100'000'000LL, {{0, 0, 0, 1}, {s, std::sin(s) + off, 0.2 * s * s}}});
  }
  return poses;
}

TEST(PublicEvaluation, MeasuresTheDistanceFromTheTruth) {
  const auto truth = walk(0);
  const TrajectoryError none = compare(truth, truth);
  EXPECT_EQ(none.pairs, 60U);
  EXPECT_LT(none.ate_rmse, 1e-9);
  const TrajectoryError some = compare(walk(0.05), truth);
  EXPECT_NEAR(some.ate_rmse, 0.05, 1e-3);
  EXPECT_GT(some.path_length, 6);
  EXPECT_THROW((void)compare({}, truth), std::invalid_argument);
  EXPECT_THROW((void)compare(truth, truth, {.max_time_difference_s = 0}), std::invalid_argument);
  const double for_ever = std::numeric_limits<double>::infinity();
  try {
    (void)compare(truth, truth, {.max_time_difference_s = for_ever});
    ADD_FAILURE() << "taken";
  } catch (const std::invalid_argument& error) {
    EXPECT_NE(std::string(error.what()).find("options.max_time_difference_s"), std::string::npos)
        << error.what();
  }
}

TEST(PublicEvaluation, RefusesPosesThatAreNone) {
  const auto truth = walk(0);
  const auto why = [&](const std::function<void(StampedPose&)>& change) {
    auto poses = truth;
    change(poses[7]);
    try {
      (void)compare(poses, truth);
    } catch (const std::invalid_argument& error) {
      return std::string(error.what());
    }
    return std::string();
  };
  const double nan = std::numeric_limits<double>::quiet_NaN();
  EXPECT_EQ(why([](StampedPose& pose) { pose.T_world_camera.q[3] = 0.995; }), "");
  EXPECT_NE(why([](StampedPose& pose) { pose.t_ns = 0; }).find("pose 7 is not after"), std::string::npos);
  EXPECT_NE(why([&](StampedPose& pose) { pose.T_world_camera.t[1] = nan; }).find("pose 7 is not of finite"),
            std::string::npos);
  EXPECT_NE(why([&](StampedPose& pose) { pose.T_world_camera.q[0] = nan; }).find("pose 7"),
            std::string::npos);
  EXPECT_NE(why([](StampedPose& pose) {
              pose.T_world_camera.q = {0, 0, 0, 2};
            }).find("unit quaternion"),
            std::string::npos);
}

TEST(PublicEvaluation, OptionsSayWhyTheyAreInvalid) {
  testing::expect_rules<ComparisonOptions>(
      {{"max_time_difference_s", [](auto& o) { o.max_time_difference_s = -1; }},
       {"max_time_difference_s", [](auto& o) { o.max_time_difference_s = 1e10; }}});
}

TEST(PublicEvaluation, FindsScaleWhenAsked) {
  auto half = walk(0);
  for (auto& pose : half) {
    for (double& x : pose.T_world_camera.t) x /= 2;
  }
  const TrajectoryError error = compare(half, walk(0), {.align = AlignBy::kSimilarity});
  EXPECT_NEAR(error.scale, 2, 1e-9);
  EXPECT_LT(error.ate_rmse, 1e-9);
}

TEST(PublicEvaluation, TrajectoriesSurviveTheirFile) {
  const ScratchFolder folder;
  const auto poses = walk(0.1);
  save_trajectory(folder / "poses.txt", poses);
  const auto read = load_trajectory(folder / "poses.txt");
  ASSERT_EQ(read.size(), poses.size());
  for (std::size_t i = 0; i < read.size(); ++i) {
    EXPECT_EQ(read[i].t_ns, poses[i].t_ns);
    for (std::size_t k = 0; k < 3; ++k)
      EXPECT_NEAR(read[i].T_world_camera.t[k], poses[i].T_world_camera.t[k], 1e-6);
  }
  EXPECT_THROW((void)load_trajectory(folder / "none.txt"), std::runtime_error);
}

}  // namespace
}  // namespace twofold
