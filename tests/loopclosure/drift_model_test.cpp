#include "loopclosure/drift_model.hpp"
#include "base/angles.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "graph/graph_writer.hpp"

namespace twofold {
namespace {

constexpr double kDepth = 5;  // [m]

/// Steps of a metre, each turned by what `yaw_deg` says of it; seen with some error of each step.
class Drive {
 public:
  explicit Drive(std::vector<double> yaw_deg) : yaw_deg_(std::move(yaw_deg)) {}

  // What is wrong with the map:
  double turn_gain = 0;  ///< share of all turns
  double bend_deg = 0;   ///< of each step
  double log_scale = 0;  ///< likewise

  [[nodiscard]] KeyframeId end() const { return KeyframeId{static_cast<std::uint32_t>(yaw_deg_.size())}; }
  /// Pose of the end relative to the beginning, lengths in the end's unit.
  [[nodiscard]] Sim3 truth() const { return way(false).back(); }
  [[nodiscard]] GraphSnapshot map() const {
    GraphWriter writer;
    const std::vector<Sim3> poses = way(true);
    for (std::size_t k = 0; k < poses.size(); ++k) {
      Keyframe keyframe;
      keyframe.id = KeyframeId{static_cast<std::uint32_t>(k)};
      keyframe.part = KeyframeId{0};
      keyframe.T_k_w = SE3(poses[k].so3(), poses[k].translation());
      keyframe.median_depth = kDepth;
      writer.add_keyframe(keyframe);
      writer.set_reference(keyframe.id);
    }
    return writer.publish();
  }
  [[nodiscard]] double chi2(SensorKind sensor, const Sim3& S_end_begin) const {
    return DriftModel(sensor, {}).chi2(map(), KeyframeId{0}, end(), S_end_begin);
  }

 private:
  [[nodiscard]] std::vector<Sim3> way(bool as_mapped) const {
    std::vector<Sim3> poses{Sim3()};
    for (const double yaw : yaw_deg_) {
      const double turn = as_mapped ? yaw * (1 + turn_gain) + bend_deg : yaw;
      const double scale = as_mapped ? 1 : std::exp(log_scale);
      poses.push_back(Sim3(scale, SO3::exp({0, turn * kDegree, 0}), Vector3(0, 0, -1)) * poses.back());
    }
    return poses;
  }

  std::vector<double> yaw_deg_;
};

Drive straight() {
  return Drive(std::vector<double>(200, 0));
}
Drive circle() {
  return Drive(std::vector<double>(180, 2));
}
/// Left and right in turn, each time by half a circle: as much turning, none of it left.
Drive slalom() {
  std::vector<double> yaw(180, 2);
  for (std::size_t k = 0; k < yaw.size(); ++k) yaw[k] *= (k + 45) / 90 % 2 == 0 ? 1 : -1;
  return Drive(yaw);
}

TEST(DriftModel, WhatTheMapSaysNeedsNoDrift) {
  for (const Drive& drive : {straight(), circle(), slalom()})
    EXPECT_LT(drive.chi2(SensorKind::kStereo, drive.truth()), 1e-6);
}

TEST(DriftModel, AFocalLengthThatIsWrongTurnsTheWayOfOneCameraOnly) {
  Drive drive = circle();
  drive.turn_gain = -0.15;
  EXPECT_LT(drive.chi2(SensorKind::kMono, drive.truth()), DriftOptions().max_chi2);
  EXPECT_GT(drive.chi2(SensorKind::kStereo, drive.truth()), DriftOptions().max_chi2);
}

/// 40 degrees after a full circle are what a focal length that is 11 % wrong leaves; after turns that cancel
/// it leaves nothing.
TEST(DriftModel, TurnsThatCancelLeaveNoDriftBehind) {
  Drive round = circle();
  round.turn_gain = -40.0 / 360;
  EXPECT_LT(round.chi2(SensorKind::kMono, round.truth()), DriftOptions().max_chi2);
  Drive to_and_fro = slalom();
  to_and_fro.bend_deg = 40.0 / 180;
  EXPECT_GT(to_and_fro.chi2(SensorKind::kMono, to_and_fro.truth()), DriftOptions().max_chi2);
}

/// A way that has turned by 40 degrees has not ended where it seemed to.
TEST(DriftModel, ShiftFollowsFromRotation) {
  Drive drive = circle();
  drive.turn_gain = -40.0 / 360;
  const Sim3 as_mapped(drive.map().T_k_w(drive.end()));
  const Sim3 turned_on_the_spot(1, drive.truth().so3(),
                                drive.truth().so3() * as_mapped.so3().inverse() * as_mapped.translation());
  EXPECT_GT(drive.chi2(SensorKind::kMono, turned_on_the_spot), DriftOptions().max_chi2);
}

TEST(DriftModel, TheScaleOfOneCameraDrifts) {
  Drive drive = circle();
  drive.log_scale = 0.3 / 180;
  EXPECT_LT(drive.chi2(SensorKind::kMono, drive.truth()), DriftOptions().max_chi2);
  EXPECT_GT(drive.chi2(SensorKind::kStereo, drive.truth()), DriftOptions().max_chi2);
  drive.log_scale = 2.0 / 180;
  EXPECT_GT(drive.chi2(SensorKind::kMono, drive.truth()), DriftOptions().max_chi2);
}

TEST(DriftModel, ChanceGrowsWithTheRootOfTheWay) {
  const auto chi2_of_shift = [](std::size_t steps) {
    const Drive drive(std::vector<double>(steps, 0));
    const Sim3 aside(1, SO3(), Vector3(kDepth, 0, 0));
    return drive.chi2(SensorKind::kStereo, aside * drive.truth());
  };
  EXPECT_GT(chi2_of_shift(5), DriftOptions().max_chi2) << "aside by all of a depth after a step of one";
  EXPECT_LT(chi2_of_shift(500), DriftOptions().max_chi2);
}

TEST(DriftModel, TheOrderOfTheKeyframesDoesNotMatter) {
  Drive drive(std::vector<double>(90, 2));
  drive.turn_gain = -0.01;
  const GraphSnapshot map = drive.map();
  const DriftModel model(SensorKind::kStereo, {});
  EXPECT_NEAR(model.chi2(map, drive.end(), KeyframeId{0}, drive.truth().inverse()),
              drive.chi2(SensorKind::kStereo, drive.truth()), 0.5);
}

/// A drive that leads nowhere, as copies of houses say.
TEST(DriftModel, AStreetDoesNotLeadNowhere) {
  for (const SensorKind sensor : {SensorKind::kStereo, SensorKind::kMono})
    EXPECT_GT(straight().chi2(sensor, Sim3()), DriftOptions().max_chi2);
}

}  // namespace
}  // namespace twofold
