#include "slam/pose_reporter.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "graph/graph_writer.hpp"
#include "slam/conversions.hpp"

namespace twofold {
namespace {

constexpr std::int64_t kPeriod = 100'000'000;

/// A graph of one keyframe, and frames tracked against it.
class PoseReporterTest : public ::testing::Test {
 protected:
  PoseReporterTest() {
    Keyframe keyframe;
    keyframe.id = KeyframeId{0};
    writer_.add_keyframe(std::move(keyframe));
    graph_ = writer_.publish();
  }

  FrameRecord tracked(int index, const SE3& T_c_w) {
    FrameRecord record;
    record.frame_index = index;
    record.t_ns = index * kPeriod;
    record.state = FrameState::kTracked;
    record.reference = KeyframeId{0};
    record.part_causal = KeyframeId{0};
    record.T_c_ref = PackedPose(T_c_w * graph_.T_k_w(KeyframeId{0}).inverse());
    record.T_c_w_causal = PackedPose(T_c_w);
    record.snapshot_version = graph_.version();
    return record;
  }
  static FrameRecord lost(int index) {
    FrameRecord record;
    record.frame_index = index;
    record.t_ns = index * kPeriod;
    record.cause = LostCause::kCovered;
    return record;
  }
  PoseEstimate report(const FrameRecord& record, const Matrix6& information = Matrix6::Identity()) {
    events_ = {};
    return reporter_.next({record, graph_, correction_, information, 7, {}, {}, {}}, events_);
  }

  GraphWriter writer_;
  GraphSnapshot graph_;
  PoseCorrection correction_;
  PoseReporter reporter_;
  PoseReporter::Events events_;
};

TEST_F(PoseReporterTest, VelocityIsOfTheCameraInItsOwnAxes) {
  // The camera looks along the world's x axis and flies along it at 2 m/s, turning by 0.5 rad/s to the right.
  const SE3 T_w_first(SO3::exp(Vector3(0, M_PI / 2, 0)), Vector3::Zero());
  const Vector6 motion = (Vector6() << 0, 0, 0.2, 0, 0.05, 0).finished();  // in 0.1 s
  EXPECT_EQ(report(tracked(0, T_w_first.inverse())).velocity, (std::array<double, 6>{}));
  const PoseEstimate second = report(tracked(1, (T_w_first * SE3::exp(motion)).inverse()));
  for (int i = 0; i < 6; ++i) EXPECT_NEAR(second.velocity[static_cast<std::size_t>(i)], 10 * motion[i], 1e-9);
}

TEST_F(PoseReporterTest, ACorrectionOfTheMapIsNoMotion) {
  (void)report(tracked(0, SE3()));
  const SE3 jump(SO3(), Vector3(0, 5, 0));
  writer_.set_pose(KeyframeId{0}, jump);
  graph_ = writer_.publish();
  correction_ = {CorrectionReason::kLoopClosure, 1, kPeriod, PackedPose(), PackedPose(jump)};
  const PoseEstimate pose = report(tracked(1, jump));
  for (const double v : pose.velocity) EXPECT_NEAR(v, 0, 1e-12);
  ASSERT_TRUE(events_.correction);
  EXPECT_EQ(events_.correction->kind, MapEventKind::kLoopClosure);
  EXPECT_EQ(events_.correction->keyframe, 0U);
  EXPECT_NEAR(events_.correction->moved, 5, 1e-12);
  EXPECT_EQ(events_.correction->T_world_camera_after, to_pose(jump.inverse()));
}

TEST_F(PoseReporterTest, OdometryDoesNotJumpWhenTheMapDoes) {
  const SE3 start(SO3::exp(Vector3(0, 0.3, 0)), Vector3(1, 2, 3));
  EXPECT_EQ(report(tracked(0, start)).T_odom_camera, Pose{}) << "it begins where the camera is";
  const SE3 step = SE3::exp((Vector6() << 0.1, 0, 0.2, 0, 0.05, 0).finished());
  (void)report(tracked(1, step.inverse() * start));
  const SE3 jump(SO3(), Vector3(0, 5, 0));  // of the map, as a loop makes it
  writer_.set_pose(KeyframeId{0}, jump);
  graph_ = writer_.publish();
  const SE3 T_c_w_moved = step.inverse() * start * jump;
  correction_ = {CorrectionReason::kLoopClosure, 1, kPeriod, PackedPose(), PackedPose(T_c_w_moved)};
  const PoseEstimate pose = report(tracked(2, step.inverse() * T_c_w_moved));
  EXPECT_LT((to_se3(pose.T_odom_camera).inverse() * step * step).log().norm(), 1e-9);
}

TEST_F(PoseReporterTest, OdometryGoesOnWhereItWasInAnotherPart) {
  (void)report(tracked(0, SE3()));
  const SE3 T_c_w(SO3(), Vector3(0, 0, -2));
  const Pose before = report(tracked(1, T_c_w)).T_odom_camera;
  EXPECT_NEAR(before.t[2], 2, 1e-12);
  (void)report(lost(2));
  FrameRecord record = tracked(3, SE3());
  record.reference = record.part_causal = KeyframeId{1};
  EXPECT_EQ(report(record).T_odom_camera, before);
}

TEST_F(PoseReporterTest, ANewPartsEventSaysWhereTheCameraWasInTheOldOne) {
  const SE3 T_c_w(SO3(), Vector3(0, 0, -2));
  (void)report(tracked(0, T_c_w));
  (void)report(lost(1));
  FrameRecord record = tracked(2, SE3());
  record.reference = record.part_causal = KeyframeId{1};
  (void)report(record);
  ASSERT_TRUE(events_.placing);
  EXPECT_EQ(events_.placing->map_part_before, 0U);
  EXPECT_EQ(events_.placing->map_part, 1U);
  EXPECT_EQ(events_.placing->T_world_camera_before, to_pose(T_c_w.inverse()));
  EXPECT_EQ(events_.placing->T_world_camera_after, Pose{});
  EXPECT_EQ(events_.placing->moved, 0) << "the two worlds share nothing";
}

TEST_F(PoseReporterTest, CovarianceIsTheInverseOfTheInformation) {
  Matrix6 A = Matrix6::Random();
  const Matrix6 information = A * A.transpose() + Matrix6::Identity();
  const PoseEstimate pose = report(tracked(0, SE3()), information);
  const Eigen::Map<const Matrix6> covariance(pose.covariance.data());
  EXPECT_LT((covariance * information - Matrix6::Identity()).norm(), 1e-9);
  EXPECT_TRUE(pose.covariance_known);
}

TEST_F(PoseReporterTest, AnUnknownCovarianceIsNoPerfectOne) {
  const PoseEstimate first = report(tracked(0, SE3()), Matrix6::Zero());
  EXPECT_TRUE(first.covariance_known) << "the first frame of a part defines its world";
  EXPECT_EQ(first.covariance, (std::array<double, 36>{}));
  Matrix6 open = Matrix6::Identity();
  open(2, 2) = 0;  // nothing was measured along the optical axis
  const Matrix6 none = Matrix6::Zero();
  for (const Matrix6& information : {open, none}) {
    const PoseEstimate pose = report(tracked(1, SE3(SO3(), Vector3(0, 0, 1))), information);
    EXPECT_FALSE(pose.covariance_known);
    for (const double value : pose.covariance) EXPECT_TRUE(std::isnan(value));
  }
  EXPECT_FALSE(report(lost(2)).covariance_known);
  EXPECT_TRUE(std::isnan(PoseEstimate{}.covariance[0]));
}

TEST_F(PoseReporterTest, ACorrectionSaysWhatItDidToTheMap) {
  EngineOptions options;
  reporter_.listen(options);
  const auto publish = [&] {
    graph_ = writer_.publish();
    options.on_next_map(graph_, {});
  };
  Keyframe keyframe;
  keyframe.id = KeyframeId{1};
  writer_.add_keyframe(std::move(keyframe));
  publish();
  (void)report(tracked(0, SE3()));
  ClosedLoop loop;
  loop.constraint.from = KeyframeId{0};
  loop.constraint.to = KeyframeId{1};
  options.on_loop(loop);
  Edge edge;
  edge.other = KeyframeId{1};
  writer_.set_edge(KeyframeId{0}, edge);
  const SE3 jump(SO3(), Vector3(0, 5, 0));
  writer_.set_pose(KeyframeId{0}, jump);
  writer_.announce_change(MapChange::Kind::kLoopClosure);
  publish();
  correction_ = {CorrectionReason::kLoopClosure, 1, kPeriod, PackedPose(), PackedPose(jump)};
  (void)report(tracked(1, jump));
  ASSERT_TRUE(events_.correction);
  EXPECT_EQ(events_.correction->loop_from, 0U);
  EXPECT_EQ(events_.correction->loop_to, 1U);
  EXPECT_EQ(events_.correction->keyframes_moved, 1U);
  EXPECT_NEAR(events_.correction->farthest_moved, 5, 1e-12);
}

/// Of the two, the other part has moved: the camera stays where it is, but what is in its world does not.
TEST_F(PoseReporterTest, APartThatJoinsTheCamerasIsToldWithoutACorrection) {
  EngineOptions options;
  reporter_.listen(options);
  Keyframe other;
  other.id = KeyframeId{1};
  other.part = KeyframeId{1};
  writer_.add_keyframe(std::move(other));
  const auto publish = [&] {
    graph_ = writer_.publish();
    options.on_next_map(graph_, {});
  };
  publish();
  const SE3 T_c_w(SO3(), Vector3(0, 0, 2));
  (void)report(tracked(0, T_c_w));
  EXPECT_FALSE(events_.correction);
  writer_.set_part(KeyframeId{1}, KeyframeId{0});
  writer_.announce_change(MapChange::Kind::kPartsJoined);
  publish();
  (void)report(tracked(1, T_c_w));
  ASSERT_TRUE(events_.correction);
  EXPECT_EQ(events_.correction->kind, MapEventKind::kPartsJoined);
  EXPECT_EQ(events_.correction->keyframes_moved, 1U);
  EXPECT_EQ(events_.correction->map_part_before, 0U);
  EXPECT_EQ(events_.correction->map_part, 0U);
  EXPECT_EQ(events_.correction->moved, 0);
  EXPECT_EQ(events_.correction->T_world_camera_after, to_pose(T_c_w.inverse()));
  (void)report(tracked(2, T_c_w));
  EXPECT_FALSE(events_.correction) << "told once";
}

TEST_F(PoseReporterTest, ALostCamerasPartIsTheOneThatWasToldLast) {
  (void)report(tracked(0, SE3()));
  Keyframe older;
  older.id = KeyframeId{1};
  writer_.add_keyframe(std::move(older));
  writer_.set_part(KeyframeId{0}, KeyframeId{1});
  graph_ = writer_.publish();
  correction_ = {CorrectionReason::kPartsJoined, 1, kPeriod, PackedPose(), PackedPose()};
  (void)report(lost(1));
  ASSERT_TRUE(events_.correction);
  EXPECT_EQ(events_.correction->map_part_before, 0U);
  EXPECT_EQ(events_.correction->map_part, 1U);
  correction_.reason = CorrectionReason::kPoseGraph;
  (void)report(lost(2));
  ASSERT_TRUE(events_.correction);
  EXPECT_EQ(events_.correction->map_part_before, 1U);
}

TEST_F(PoseReporterTest, ALostCameraThatFindsItselfIsAnEvent) {
  (void)report(tracked(0, SE3()));
  const PoseEstimate gone = report(lost(1));
  EXPECT_EQ(gone.state, TrackingState::kLost);
  EXPECT_STREQ(gone.reason, describe(LostCause::kCovered));
  EXPECT_EQ(gone.map_part, kNoId);
  EXPECT_FALSE(events_.placing);
  const SE3 elsewhere(SO3(), Vector3(0, 0, 3));
  (void)report(tracked(2, elsewhere));
  ASSERT_TRUE(events_.placing);
  EXPECT_EQ(events_.placing->kind, MapEventKind::kRelocalisation);
  EXPECT_NEAR(events_.placing->moved, 3, 1e-12);
  EXPECT_EQ(events_.placing->map_part_before, 0U);
  (void)report(tracked(3, elsewhere));
  EXPECT_FALSE(events_.placing);
}

TEST_F(PoseReporterTest, APartThatTheMapDoesNotHaveYetIsNew) {
  (void)report(tracked(0, SE3()));
  (void)report(lost(1));
  FrameRecord record = tracked(2, SE3());
  record.reference = record.part_causal = KeyframeId{1};
  const PoseEstimate pose = report(record);
  EXPECT_EQ(pose.map_part, 1U);
  EXPECT_EQ(pose.velocity, (std::array<double, 6>{})) << "worlds of different parts have nothing in common";
  ASSERT_TRUE(events_.placing);
  EXPECT_EQ(events_.placing->kind, MapEventKind::kNewPart);
  (void)report(lost(3));
  record = tracked(4, SE3());
  record.reference = record.part_causal = KeyframeId{1};
  (void)report(record);
  ASSERT_TRUE(events_.placing);
  EXPECT_EQ(events_.placing->kind, MapEventKind::kRelocalisation) << "the part is not new any more";
}

}  // namespace
}  // namespace twofold
