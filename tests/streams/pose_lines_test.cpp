#include "streams/pose_lines.hpp"

#include <gtest/gtest.h>

#include "tests/streams/numbered_poses.hpp"

namespace twofold {
namespace {

using nlohmann::json;
using testing::numbered_pose;

TEST(PoseLines, JsonHasAllThatIsKnownOfATrackedFrame) {
  PoseEstimate pose = numbered_pose(12);
  pose.T_world_camera.q = {0, 0.6, 0, 0.8};
  pose.covariance = {};
  pose.covariance[35] = 0.125;
  pose.covariance_known = true;
  pose.T_odom_camera = {{0, 0.8, 0, 0.6}, {3, 0.5, -2}};
  pose.velocity = {1, 2, 3, 4, 5, 6};
  pose.exposed_ns = 99;
  pose.latency_ns = 1500;
  pose.map_version = 7;
  const std::string text = pose_line(pose, PoseForm::kJson);
  EXPECT_EQ(text.find('\n'), text.size() - 1);
  const json line = json::parse(text);
  EXPECT_EQ(line["frame"], 12);
  EXPECT_EQ(line["t_ns"], 1'000'000'012);
  EXPECT_EQ(line["state"], "tracked");
  EXPECT_EQ(line["position"], json({12.0, 0.25, -1.0}));
  EXPECT_EQ(line["orientation"], json({0.0, 0.6, 0.0, 0.8}));
  EXPECT_EQ(line["map_part"], 0);
  EXPECT_EQ(line["reference_keyframe"], 2);
  EXPECT_EQ(line["covariance"].size(), 36U);
  EXPECT_EQ(line["covariance"][35], 0.125);
  EXPECT_EQ(line["position_in_odom"], json({3.0, 0.5, -2.0}));
  EXPECT_EQ(line["orientation_in_odom"], json({0.0, 0.8, 0.0, 0.6}));
  EXPECT_EQ(line["velocity"], json({1, 2, 3, 4, 5, 6}));
  EXPECT_EQ(line["exposed_ns"], 99);
  EXPECT_EQ(line["latency_ns"], 1500);
  EXPECT_EQ(line["map_version"], 7);
}

TEST(PoseLines, AnUnknownCovarianceIsNull) {
  const json line = json::parse(pose_line(numbered_pose(1), PoseForm::kJson));
  EXPECT_TRUE(line.at("covariance").is_null());
}

TEST(PoseLines, ALostFrameHasAReasonAndNoPose) {
  PoseEstimate pose = numbered_pose(3);
  pose.state = TrackingState::kLost;
  pose.reason = "covered";
  const json line = json::parse(pose_line(pose, PoseForm::kJson));
  EXPECT_EQ(line["state"], "lost");
  EXPECT_EQ(line["reason"], "covered");
  EXPECT_FALSE(line.contains("position"));
  EXPECT_EQ(pose_line(pose, PoseForm::kTum), "");
}

TEST(PoseLines, TumFormIsTimeAndPose) {
  EXPECT_EQ(pose_line(numbered_pose(5), PoseForm::kTum), "1.000000005 5 0.25 -1 0 0 0 1\n");
  PoseEstimate early = numbered_pose(5);
  early.t_ns = -966'666'667;
  EXPECT_EQ(pose_line(early, PoseForm::kTum), "-0.966666667 5 0.25 -1 0 0 0 1\n");
  EXPECT_EQ(missed_line(4, PoseForm::kTum), "# missed 4 lines\n");
}

TEST(PoseLines, ZeroHasOneSign) {
  PoseEstimate pose = numbered_pose(5);
  pose.T_world_camera.t = {-0.0, 0.0, -1};
  for (const PoseForm form : {PoseForm::kJson, PoseForm::kTum}) {
    const std::string line = pose_line(pose, form);
    EXPECT_EQ(line.find("-0,"), std::string::npos) << line;
    EXPECT_EQ(line.find("-0 "), std::string::npos) << line;
  }
}

TEST(PoseLines, EventsSayWhatMovedAndByHowMuch) {
  MapEvent event;
  event.kind = MapEventKind::kLoopClosure;
  event.frame = 8;
  event.moved = 0.5;
  event.loop_from = 3;
  event.keyframes_moved = 17;
  event.farthest_moved = 2.5;
  event.T_world_camera_after.t = {1, 2, 3};
  const json line = json::parse(event_line(event, PoseForm::kJson));
  EXPECT_EQ(line["event"], "loop closure");
  EXPECT_EQ(line["frame"], 8);
  EXPECT_EQ(line["moved"], 0.5);
  EXPECT_EQ(line["loop_from"], 3);
  EXPECT_TRUE(line["loop_to"].is_null());
  EXPECT_EQ(line["keyframes_moved"], 17);
  EXPECT_EQ(line["farthest_moved"], 2.5);
  EXPECT_EQ(line["position"], json({1.0, 2.0, 3.0}));
  EXPECT_EQ(event_line(event, PoseForm::kTum).substr(0, 24), "# loop closure at frame ");
  const json nothing = json::parse(event_line(MapEvent{}, PoseForm::kJson));
  for (const char* id : {"keyframe", "map_part_before", "map_part", "loop_from", "loop_to"})
    EXPECT_TRUE(nothing[id].is_null()) << id;
  EXPECT_EQ(json::parse(missed_line(4, PoseForm::kJson))["missed"], 4);
}

}  // namespace
}  // namespace twofold
