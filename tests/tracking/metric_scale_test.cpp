// A courtyard of which a depth camera reaches a strip of the ground and the next tree: how long is a motion?
#include "tracking/monocular/metric_scale.hpp"

#include <gtest/gtest.h>

#include "imaging/image_buffers.hpp"
#include "synthetic/synthetic_sequence.hpp"

namespace twofold {
namespace {

using synthetic::SyntheticOptions;
using synthetic::SyntheticSequence;

class MetricScale : public ::testing::Test {
 protected:
  static SyntheticOptions courtyard() {
    SyntheticOptions scene;
    scene.scene = "courtyard";
    scene.sensor = SensorKind::kRgbd;
    scene.width = 320;
    scene.height = 240;
    scene.f = 210;
    scene.fps = 15;
    scene.frames = 60;
    scene.depth_max = 3;
    return scene;
  }
  [[nodiscard]] FrameImages images(int index) const {
    const Frame frame = sequence_.render(index);
    FrameImages images;
    allocate_images(sequence_.rig(), images);
    images.left.build(frame.left);
    frame.depth.copyTo(images.depth);
    return images;
  }
  [[nodiscard]] SE3 T_b_a(int a, int b) const { return sequence_.T_w_c(b).inverse() * sequence_.T_w_c(a); }

  const SyntheticSequence sequence_{courtyard()};
};

TEST_F(MetricScale, IsThatOfTheTrueMotion) {
  double sum = 0;
  int found = 0;
  for (int a = 0; a + 4 < sequence_.frame_count(); a += 5) {
    const SE3 truth = T_b_a(a, a + 4);
    const double metres = truth.translation().norm();
    const SE3 motion(truth.so3(), truth.translation() / metres);
    const auto scale = metric_scale(sequence_.rig(), images(a), images(a + 4), motion);
    if (!scale) continue;
    EXPECT_NEAR(*scale / metres, 1, 0.02) << "from frame " << a;
    sum += *scale / metres;
    ++found;
  }
  ASSERT_GE(found, 9) << "of 12";
  EXPECT_NEAR(sum / found, 1, 0.005);
}

TEST_F(MetricScale, IsUnknownOfAnotherMotion) {
  for (int a = 0; a + 4 < sequence_.frame_count(); a += 5) {
    const SE3 truth = T_b_a(a, a + 4);
    const SE3 turned = SE3::exp((Vector6() << 0, 0, 0, 0.05, 0.05, 0).finished()) * truth;
    EXPECT_FALSE(metric_scale(sequence_.rig(), images(a), images(a + 4), turned)) << "from frame " << a;
  }
}

TEST_F(MetricScale, IsUnknownWhereTheCameraStands) {
  const SE3 forward(SO3(), Vector3(0, 0, -1));
  EXPECT_FALSE(metric_scale(sequence_.rig(), images(3), images(3), forward));
}

TEST_F(MetricScale, IsUnknownWithoutDepth) {
  FrameImages a = images(0), b = images(4);
  const SE3 truth = T_b_a(0, 4);
  ASSERT_TRUE(metric_scale(sequence_.rig(), a, b, truth));
  a.depth.setTo(0);
  b.depth.setTo(0);
  EXPECT_FALSE(metric_scale(sequence_.rig(), a, b, truth));
}

}  // namespace
}  // namespace twofold
