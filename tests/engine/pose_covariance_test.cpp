// Whether the poses of whole runs are as exact as their covariances say.
#include <gtest/gtest.h>

#include <cstdio>
#include <string>

#include "fixtures/pose_consistency.hpp"
#include "tests/engine/whole_run.hpp"

namespace twofold {
namespace {

using synthetic::SyntheticOptions;
using synthetic::SyntheticSequence;

/// Mean over frames of the squared error relative to the reference keyframe over its covariance and 6.
double nees(const std::string& scene, double noise) {
  SyntheticOptions options;
  options.scene = scene;
  options.width = 320;
  options.height = 240;
  options.f = 210;
  options.frames = 120;
  options.noise = noise;
  const SyntheticSequence sequence(options);
  const RelativeTruth truth(testing::true_path(sequence), {});
  double sum = 0;
  int count = 0;
  EngineOptions engine;
  engine.on_pose = [&](const PoseReport& report) {
    const FrameRecord& record = report.record;
    if (record.state != FrameState::kTracked || !report.graph.contains(record.reference)) return;
    const std::int64_t t_ref_ns = report.graph.keyframe(record.reference).t_ns;
    if (t_ref_ns == record.t_ns) return;
    const auto comparison = truth.compare(record.T_c_ref.unpacked(), record.t_ns, t_ref_ns);
    ASSERT_TRUE(comparison);
    sum += comparison->normalised(report.information.inverse());
    ++count;
  };
  const auto run = testing::run_whole(sequence.rig(), testing::frames_of(sequence), engine);
  EXPECT_GT(count, 100);
  std::printf("%s, noise %.0f: NEES / 6 %.2f\n", scene.c_str(), noise, sum / count);
  return sum / count;
}

/// 1 where it is honest; a covariance that is wrong by a factor of three falls out on one side.
TEST(PoseCovariance, IsHonestWithoutNoiseAndWithMuch) {
  double mean = 0;
  for (const double noise : {0.0, 2.0, 4.0}) {
    const double here = nees("courtyard", noise);
    EXPECT_GT(here, 0.3) << noise;
    EXPECT_LT(here, 3) << noise;
    mean += here / 3;
  }
  EXPECT_GT(mean, 0.4);
  EXPECT_LT(mean, 1.6);
}

TEST(PoseCovariance, IsHonestAlongACorridor) {
  const double here = nees("corridor", 2);
  EXPECT_GT(here, 0.4);
  EXPECT_LT(here, 1.6);
}

}  // namespace
}  // namespace twofold
