#include "viewer/scene.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cstring>
#include <fstream>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "tests/viewer/small_map.hpp"
#include "viewer/texts.hpp"

namespace twofold {
namespace {

using testing::small_map;
using testing::tracked_pose;

std::string hexadecimal(const std::string& bytes) {
  std::string text;
  for (const char c : bytes) text += fmt::format("{:02x}", static_cast<unsigned char>(c));
  return text;
}

/// The records of one kind in a delta.
template <class Record>
std::vector<Record> records(const ViewScene::Delta& delta, ViewBlock kind) {
  std::vector<Record> found;
  for (const auto& message : delta) {
    for (std::size_t at = sizeof(ViewMessageHeader); at < message->size();) {
      std::uint32_t block[2];
      std::memcpy(block, message->data() + at, sizeof block);
      const std::size_t sizes[] = {0, 28, 4, 52, 4, 12, 8, 60, 4};
      at += sizeof block;
      if (block[0] == static_cast<std::uint32_t>(kind)) {
        const std::size_t before = found.size();
        found.resize(before + block[1]);
        std::memcpy(static_cast<void*>(&found[before]), message->data() + at, block[1] * sizeof(Record));
      }
      at += block[1] * sizes[block[0]];
    }
  }
  return found;
}

TEST(ViewScene, MessagesAreThoseThatThePageIsTestedWith) {
  ViewScene scene;
  ViewMap first = small_map(3);
  first.edges[1].loop = kClosesLoop;
  scene.show(first);
  const std::array<std::int64_t, 2> stages{1'000'000, 2'500'000};
  scene.add(tracked_pose(4, 2), stages, {.frames = 2, .keyframes = 7}, {.lost = 3});
  const auto whole = scene.delta(0);
  const Revision before = scene.revision();
  ViewMap map = small_map(3, 2);
  map.keyframes.erase(map.keyframes.begin() + 1);
  map.points.erase(map.points.begin());
  map.edges.erase(map.edges.begin());
  scene.show(map);
  const auto later = scene.delta(before);
  ASSERT_EQ(whole->size(), 1U);
  ASSERT_EQ(later->size(), 1U);
  std::ifstream in(TWOFOLD_MESSAGES);
  const auto messages = nlohmann::json::parse(in);
  EXPECT_EQ(hexadecimal(*(*whole)[0]), messages["whole"].get<std::string>());
  EXPECT_EQ(hexadecimal(*(*later)[0]), messages["later"].get<std::string>());
  const std::string live(reinterpret_cast<const char*>(&scene.live(0)), sizeof(ViewLiveFrame));
  EXPECT_EQ(hexadecimal(live), messages["live"].get<std::string>());
}

TEST(ViewScene, FramesMoveToAnotherKeyframeWhenTheirsGoes) {
  ViewScene scene;
  scene.show(small_map(3));
  scene.add(tracked_pose(4, 2), {});
  ViewMap map = small_map(2, 2);
  map.keyframes[1].position[1] = 5;  // the map has moved it, and what hung on keyframe 2 moves along
  scene.show(map);
  const auto path = records<ViewPathFrame>(*scene.delta(0), ViewBlock::kPath);
  ASSERT_EQ(path.size(), 1U);
  EXPECT_EQ(path[0].reference, 1U);
  EXPECT_FLOAT_EQ(path[0].in_reference[0], 1);  // keyframe 2 was one metre to the right of it
  EXPECT_FLOAT_EQ(path[0].in_reference[1], 0);
  EXPECT_FLOAT_EQ(path[0].in_reference[2], 0.125);
  EXPECT_FLOAT_EQ(path[0].causal[0], 2);
}

TEST(ViewScene, DroppedFramesAreOnThePath) {
  ViewScene scene;
  const auto add = [&scene](std::int64_t frame, std::int64_t dropped) {
    scene.add(tracked_pose(frame, 0), {}, {}, {.dropped = dropped, .lost = 2});
  };
  add(10, 0);
  add(11, 0);
  add(14, 2);     // 12 and 13
  add(20, 4);     // 15 to 17 were not told, 18 and 19 were dropped
  add(500, 400);  // more than are worth a mark each
  const auto path = records<ViewPathFrame>(*scene.delta(0), ViewBlock::kPath);
  ASSERT_EQ(path.size(), 9U + ViewScene::kMostDropped);
  std::vector<std::uint32_t> dropped;
  for (std::size_t i = 0; i < 8; ++i)
    if (path[i].state == kViewDropped) dropped.push_back(path[i].frame);
  EXPECT_EQ(dropped, (std::vector<std::uint32_t>{12, 13, 18, 19}));
  for (std::size_t i = 1; i < path.size(); ++i) {
    EXPECT_GT(path[i].frame, path[i - 1].frame);
    EXPECT_GT(path[i].t, path[i - 1].t);
  }
  EXPECT_EQ(path[8].frame, 500 - ViewScene::kMostDropped);
  EXPECT_EQ(scene.reasons()[path[2].reason], "dropped: a newer frame was there, or no room to wait");
  EXPECT_EQ(path[2].reference, kNoId);
  EXPECT_EQ(scene.live(4).frames_dropped, 400U);
  EXPECT_EQ(scene.live(4).frames_lost, 2U);
}

TEST(ViewScene, WhoTellsOfNoDroppedFramesHasNone) {
  ViewScene scene;
  scene.add(tracked_pose(1, 0), {});
  scene.add(tracked_pose(100, 0), {});
  EXPECT_EQ(records<ViewPathFrame>(*scene.delta(0), ViewBlock::kPath).size(), 2U);
  EXPECT_EQ(scene.live(1).frames_dropped, kViewNotKnown);
}

TEST(ViewScene, NoticesGrossMotionOfPointsOnly) {
  ViewScene scene;
  ViewMap map = small_map(2);
  scene.show(map);
  const Revision before = scene.revision();
  map.points[0].position[0] += 0.001F;
  map.points[1].position[0] += 0.01F;
  map.version = 2;
  scene.show(map);
  const auto points = records<ViewPoint>(*scene.delta(before), ViewBlock::kPoints);
  ASSERT_EQ(points.size(), 1U);
  EXPECT_EQ(points[0].id, 3U);
}

TEST(ViewScene, LargeMapsComeInMessagesOfBoundedSize) {
  ViewScene scene;
  scene.show(small_map(20000));
  const auto delta = scene.delta(0);
  EXPECT_GT(delta->size(), 5U);
  std::size_t last = 0;
  for (const auto& message : *delta) {
    EXPECT_LE(message->size(), ViewScene::kMessageBytes);
    ViewMessageHeader header;
    std::memcpy(&header, message->data(), sizeof header);
    EXPECT_EQ((header.number & kWhole) != 0, message == delta->front());
    last += (header.number & kLast) != 0;
  }
  EXPECT_EQ(last, 1U);
  const auto points = records<ViewPoint>(*delta, ViewBlock::kPoints);
  ASSERT_EQ(points.size(), 20000U);
  EXPECT_EQ(points.back().id, 3U * 19999);
  EXPECT_EQ(scene.delta(0), delta) << "made twice";
}

TEST(ViewScene, PathIsThinnedOutEvenlyAndNeverForgotten) {
  ViewScene scene;
  constexpr std::uint32_t kFrames = 20 * ViewScene::kMaxPath;  // six hours at 30 frames a second
  for (std::uint32_t n = 0; n < kFrames; ++n) scene.add(ViewPathFrame{.frame = n});
  const auto path = records<ViewPathFrame>(*scene.delta(0), ViewBlock::kPath);
  EXPECT_LE(path.size(), ViewScene::kMaxPath);
  EXPECT_GE(path.size(), ViewScene::kMaxPath / 2);
  EXPECT_EQ(path.front().frame, 0U);
  EXPECT_EQ(path.back().frame, kFrames - 1);
  for (std::size_t i = path.size() - ViewScene::kMaxPath / 4; i < path.size(); ++i)
    ASSERT_EQ(path[i].frame, path[i - 1].frame + 1) << "the newest are all there";
  std::uint32_t longest = 0;
  for (std::size_t i = 1; i < path.size(); ++i)
    longest = std::max(longest, path[i].frame - path[i - 1].frame);
  EXPECT_LE(longest, 64U) << "no stretch is thinner than the others";
}

TEST(ViewScene, ReasonsAreNumbered) {
  ViewScene scene;
  PoseEstimate pose = tracked_pose(1, 0);
  pose.state = TrackingState::kLost;
  pose.reason = "too dark";
  scene.add(pose, {});
  scene.add(tracked_pose(2, 0), {});
  EXPECT_EQ(scene.live(0).reason, 1);
  EXPECT_EQ(scene.live(1).reason, 0);
  EXPECT_EQ(scene.reasons(), (std::vector<std::string>{"", "too dark"}));
}

TEST(ViewScene, DeviationsAreCodedWithinATenth) {
  for (double deviation = 1e-4; deviation < 100; deviation *= 1.3)
    EXPECT_NEAR(std::exp2((deviation_code(deviation) - 128) / 8.0) / deviation, 1, 0.1);
  EXPECT_EQ(deviation_code(0), 0);
}

TEST(ViewScene, ALoopIsAnEventOnceAndSaysItsScale) {
  ViewScene scene;
  scene.begin(1'000'000'000);
  scene.show(small_map(3));
  MapSnapshot::Loop loop{
      .from = 0, .to = 2, .t_ns = 3'000'000'000, .inliers = 41, .scale = 1.0625, .drift = 0.5};
  loop.travelled = 53;
  scene.add_loops({loop});
  scene.add_loops({loop});
  ASSERT_EQ(scene.end_event(), 1U);
  loop.to = 77;  // not in the picture any more
  scene.add_loops({loop, loop});
  ASSERT_EQ(scene.end_event(), 2U) << "the second, which is new";
  const ViewEvent& first = scene.event(0);
  EXPECT_EQ(first.kind, "loop");
  EXPECT_EQ(first.t, 2);
  EXPECT_EQ(first.frame, 20U);
  EXPECT_EQ(first.after[0], 2) << "where the camera came back";
  const auto told = nlohmann::json::parse(events_text(scene, 0)).at("events");
  EXPECT_EQ(told[0].at("loop").at("scale"), 1.0625);
  EXPECT_EQ(told[0].at("loop").at("from"), 0);
  EXPECT_EQ(told[0].at("loop").at("travelled"), 53);
  EXPECT_EQ(told[0].at("moved"), 0.5);
  scene.add(MapEvent{});
  EXPECT_TRUE(nlohmann::json::parse(events_text(scene, 2)).at("events")[0].at("loop").is_null());
}

TEST(ViewScene, EdgesThatCloseLoopsAreThoseOfTheLoops) {
  ViewMap map = small_map(5);
  map.keyframes.erase(map.keyframes.begin() + 3);  // keyframe 2 stands for it
  MapSnapshot::Loop closes, joins, along;
  closes.from = 0, closes.to = 3;
  joins.from = 1, joins.to = 4, joins.joins_parts = true;
  along.from = 1, along.to = 2;  // an edge there is already
  mark_loops({closes, joins, along}, map);
  std::vector<std::array<int, 3>> marked;
  for (const ViewEdge& edge : map.edges)
    if (edge.loop != kNoLoop)
      marked.push_back({static_cast<int>(edge.from), static_cast<int>(edge.to), edge.loop});
  EXPECT_EQ(marked, (std::vector<std::array<int, 3>>{{0, 2, 1}, {1, 2, 1}, {1, 4, 2}}));
  EXPECT_EQ(map.edges.size(), 6U) << "two were added";
  EXPECT_TRUE(std::is_sorted(map.edges.begin(), map.edges.end(),
                             [](const ViewEdge& a, const ViewEdge& b) { return a.key() < b.key(); }));
}

/// A correction that version 2 of the map made, seen by a frame before the viewer has that map.
MapEvent correction_of(std::uint64_t version) {
  MapEvent event;
  event.kind = MapEventKind::kPoseGraph;
  event.t_ns = 2'000'000'000;
  event.map_version = version;
  event.keyframe = 2;
  event.map_part = event.map_part_before = 0;
  return event;
}

TEST(ViewScene, ACorrectionSaysTheScaleWhereTheUnitIsArbitrary) {
  ViewScene scene;
  scene.find_scales();
  scene.show(small_map(3));
  scene.add(correction_of(2));
  MapEvent found;
  found.kind = MapEventKind::kRelocalisation;
  scene.add(found);
  EXPECT_EQ(scene.end_event(), 0U) << "waits for the map that it tells of, and the next for its turn";
  ViewMap map = small_map(3, 2);
  for (ViewKeyframe& keyframe : map.keyframes) keyframe.position[0] = 5 + 1.25F * keyframe.position[0];
  scene.show(map);
  ASSERT_EQ(scene.end_event(), 2U);
  ASSERT_TRUE(scene.event(0).scale);
  EXPECT_NEAR(*scene.event(0).scale, 1.25, 1e-6);
  EXPECT_FALSE(scene.event(1).scale);
  EXPECT_EQ(nlohmann::json::parse(events_text(scene, 0)).at("events")[0].at("scale"), *scene.event(0).scale);
  scene.add(correction_of(9));
  scene.release_events(9);
  EXPECT_EQ(scene.end_event(), 3U) << "not for ever";
}

TEST(ViewScene, ACorrectionInMetresIsToldAtOnce) {
  ViewScene scene;
  scene.show(small_map(3));
  scene.add(correction_of(2));
  ASSERT_EQ(scene.end_event(), 1U);
  EXPECT_FALSE(scene.event(0).scale);
}

}  // namespace
}  // namespace twofold
