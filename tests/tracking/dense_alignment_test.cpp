#include "tracking/common/dense_alignment.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <random>
#include <vector>

#include "fixtures/rendered_scene.hpp"

namespace twofold {
namespace {

using testing::RenderedScene;
using testing::test_rig;

class DenseAlignmentTest : public ::testing::Test {
 protected:
  void SetUp() override {
    scene_.render(SE3(), 2, previous_);
    std::mt19937 random(5);
    std::uniform_real_distribution<float> u(10, 310), v(10, 230);
    for (int i = 0; i < 200; ++i) {
      const Eigen::Vector2f uv(u(random), v(random));
      const Vector2 at = uv.cast<double>();
      points_.push_back({uv, rig_.camera.unproject(at) * scene_.depth(SE3(), at)});
    }
  }
  DenseAlignmentResult align(const SE3& T_cur_prev, double gain = 1, double offset = 0) {
    cv::Mat image = scene_.render_one(T_cur_prev, 2);
    image.convertTo(image, CV_8UC1, gain, offset);
    current_.left.build(image);
    return alignment_.align(rig_.camera, previous_.left, current_.left, points_, SE3());
  }

  Rig rig_ = test_rig(SensorKind::kStereo, 320, 240);
  RenderedScene scene_{rig_, {3, 2, 4}, 11};
  FrameImages previous_, current_;
  std::vector<AlignmentPoint> points_;
  DenseAlignment alignment_{240, {}};
};

/// Largest distance between where two poses put the points [px].
double worst_pixel(const Rig& rig, const std::vector<AlignmentPoint>& points, const SE3& a, const SE3& b) {
  double worst = 0;
  for (const AlignmentPoint& point : points) {
    worst = std::max(worst, (rig.camera.project(a * point.x) - rig.camera.project(b * point.x)).norm());
  }
  return worst;
}

TEST_F(DenseAlignmentTest, BasinIsTensOfPixelsWide) {
  struct Motion {
    const char* name;
    Vector6 xi;
  };
  const std::array motions{
      Motion{"rest", Vector6::Zero()},
      Motion{"yaw 3 deg", (Vector6() << 0, 0, 0, 0, 0.05, 0).finished()},
      Motion{"yaw 5 deg", (Vector6() << 0, 0, 0, 0, 0.09, 0).finished()},
      Motion{"pitch -4 deg", (Vector6() << 0, 0, 0, -0.07, 0, 0).finished()},
      Motion{"roll 8 deg", (Vector6() << 0, 0, 0, 0, 0, 0.14).finished()},
      Motion{"sideways 0.15 m", (Vector6() << 0.15, 0, 0, 0, 0, 0).finished()},
      Motion{"forward 0.4 m", (Vector6() << 0, 0, -0.4, 0, 0, 0).finished()},
      Motion{"all", (Vector6() << 0.06, -0.03, 0.1, 0.03, -0.04, 0.05).finished()},
  };
  for (const Motion& motion : motions) {
    const SE3 truth = SE3::exp(motion.xi);
    const DenseAlignmentResult result = align(truth);
    const double start = worst_pixel(rig_, points_, SE3(), truth);
    const double left = worst_pixel(rig_, points_, result.T_cur_prev, truth);
    std::printf("%-16s starts %.1f px off, ends %.2f px off, rms %.1f grey\n", motion.name, start, left,
                result.rms);
    EXPECT_TRUE(result.converged) << motion.name;
    EXPECT_LT(left, 1.0) << motion.name;  // inside the radius of the guided search
  }
}

TEST_F(DenseAlignmentTest, EstimatesGainAndOffset) {
  const SE3 truth = SE3::exp((Vector6() << 0.05, 0, 0.05, 0.02, -0.03, 0.02).finished());
  const DenseAlignmentResult result = align(truth, 0.7, 25);
  EXPECT_LT(worst_pixel(rig_, points_, result.T_cur_prev, truth), 1.0);
  EXPECT_NEAR(result.gain, 0.7, 0.03);
  EXPECT_NEAR(result.offset, 25, 4);
}

TEST_F(DenseAlignmentTest, SaysHowBadlyAnotherPlaceFits) {
  RenderedScene other(rig_, {3, 2, 4}, 77);
  const DenseAlignmentResult same = align(SE3());
  current_.left.build(other.render_one(SE3(), 2));
  const DenseAlignmentResult different =
      alignment_.align(rig_.camera, previous_.left, current_.left, points_, SE3());
  EXPECT_LT(same.rms, 5);
  EXPECT_GT(different.rms, 3 * same.rms);
}

TEST_F(DenseAlignmentTest, WithoutPointsDoesNotConverge) {
  points_.clear();
  const DenseAlignmentResult result = align(SE3::exp((Vector6() << 0.05, 0, 0, 0, 0, 0).finished()));
  EXPECT_FALSE(result.converged);
  EXPECT_EQ(result.T_cur_prev.log().norm(), 0);
}

}  // namespace
}  // namespace twofold
