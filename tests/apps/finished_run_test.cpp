#include "apps/twofold/view/finished_run.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cstring>

#include "apps/twofold/view/run_frames.hpp"
#include "io/files/ply.hpp"
#include "io/files/trajectory_file.hpp"
#include "tests/io/scratch_folder.hpp"

namespace twofold {
namespace {

constexpr std::int64_t kFrameNs = 50'000'000;

/// Poses of these frames, at x = their number.
Trajectory poses(const std::vector<int>& frames) {
  Trajectory trajectory;
  for (const int n : frames) {
    TimedPose pose;
    pose.t_ns = 1'000'000'000 + n * kFrameNs;
    pose.T_w_c.translation().x() = n;
    trajectory.push_back(pose);
  }
  return trajectory;
}

/// The records of one kind in the whole scene.
template <class Record>
std::vector<Record> records(const ViewScene& scene, ViewBlock kind) {
  std::vector<Record> found;
  const auto delta = scene.delta(0);
  for (const auto& message : *delta) {
    for (std::size_t at = sizeof(ViewMessageHeader); at < message->size();) {
      std::uint32_t block[2];
      std::memcpy(block, message->data() + at, sizeof block);
      const std::size_t sizes[] = {0, 28, 4, 52, 4, 12, 8, 60, 4};
      at += sizeof block;
      if (block[0] == static_cast<std::uint32_t>(kind)) {
        found.resize(found.size() + block[1]);
        std::memcpy(static_cast<void*>(&found[found.size() - block[1]]), message->data() + at,
                    block[1] * sizeof(Record));
      }
      at += block[1] * sizes[block[0]];
    }
  }
  return found;
}

/// Frames 0 and 1 lost, 2 to 5 tracked, 6 dropped, 7 lost, 8 to 10 tracked in a part of their own, 11 lost.
class FinishedRunTest : public ::testing::Test {
 protected:
  FinishedRunTest() {
    write_part("", {2, 3, 4, 5}, {2, 4}, {{Vector3(1, 2, 3), {}, 0.125F, 1, 5}});
    write_part("-2", {8, 9, 10}, {8, 10}, {{Vector3(4, 5, 6), {}, 0.25F, 0, 2}});
    write_tum_trajectory(folder_.path() / "trajectory_causal.txt", poses({2, 3, 4, 5}));
    folder_.write("edges.txt", "0 1 12 covisible\n");
    folder_.write("edges-2.txt", "0 1 13 marginalised\n");
    folder_.write("summary.json", R"({"source": "test", "scale": "arbitrary",
      "why_lost": [{"frame": 0, "cause": "too dark", "ms_since_previous": 0}, {"frame": 1, "cause": "too dark", "ms_since_previous": 50},
                   {"frame": 7, "cause": "too fast", "ms_since_previous": 50}, {"frame": 11, "cause": "too fast", "ms_since_previous": 50}],
      "why_late": [{"frame": 4, "latency_ms": 80, "cause": "tracking it took long"}, {"frame": 6, "cause": "dropped"}],
      "closed_loops": [{"t_ns": 1500000000, "from": 1, "from_t_ns": 1100000000, "to": 9, "inliers": 30, "scale": 1.5, "joins_parts": true}],
      "pose_corrections": [{"frame": 9, "t_ns": 1450000000, "reason": "optimisation", "moved_m": 0.5}],
      "relocalisations": [{"frame": 8, "t_ns": 1400000000, "lost_frames": 1, "new_part": true, "moved_m": null, "turned_rad": null},
                          {"frame": 10, "t_ns": 1500000000, "lost_frames": 1, "new_part": false, "moved_m": 0.25, "turned_rad": 0.5}]})");
  }
  void write_part(const std::string& suffix, const std::vector<int>& frames,
                  const std::vector<int>& keyframes, const std::vector<PlyPoint>& points) const {
    write_tum_trajectory(folder_.path() / ("trajectory" + suffix + ".txt"), poses(frames));
    write_tum_trajectory(folder_.path() / ("keyframes" + suffix + ".txt"), poses(keyframes));
    write_ply(folder_.path() / ("map" + suffix + ".ply"), points);
  }
  /// As a run writes it today.
  void write_frames() const {
    std::string lines = "# frame ...\n";
    for (int n = 0; n < 12; ++n) {
      const bool tracked = (n >= 2 && n <= 5) || (n >= 8 && n <= 10);
      lines += std::to_string(n) + " " + std::to_string(1'000'000'000 + n * kFrameNs) +
               (tracked  ? " tracked"
                : n == 6 ? " dropped"
                         : " lost") +
               " 25.5 7.25 2\n";
    }
    folder_.write("frames.txt", lines);
  }
  void show() { show_finished_run(folder_.path(), scene_, title_); }
  [[nodiscard]] std::vector<ViewPathFrame> path() const {
    return records<ViewPathFrame>(scene_, ViewBlock::kPath);
  }

  ScratchFolder folder_;
  ViewScene scene_;
  ViewTitle title_;
};

TEST_F(FinishedRunTest, FramesHaveTheirOwnNumbersWithSeveralParts) {
  for (const bool with_file : {false, true}) {
    if (with_file) write_frames();
    scene_ = ViewScene();
    show();
    const auto frames = path();
    ASSERT_EQ(frames.size(), 12U) << with_file;
    for (std::uint32_t n = 0; n < 12; ++n) {
      EXPECT_EQ(frames[n].frame, n);
      EXPECT_NEAR(frames[n].t, 0.05 * n, 1e-5) << "ascending, from the first frame on, lost or not";
      if (frames[n].state == 0) {
        EXPECT_EQ(frames[n].causal[0], static_cast<float>(n)) << "the pose is its own";
      }
    }
    for (const std::uint32_t n : {0, 1, 7, 11})
      EXPECT_EQ(frames[n].state, static_cast<int>(TrackingState::kLost)) << n;
    EXPECT_EQ(frames[6].state, kViewDropped);
    EXPECT_EQ(scene_.reasons()[frames[11].reason], "too fast");
    EXPECT_EQ(scene_.reasons()[frames[4].reason], "tracking it took long");
  }
}

TEST_F(FinishedRunTest, PartsAreParts) {
  show();
  const auto keyframes = records<ViewKeyframe>(scene_, ViewBlock::kKeyframes);
  ASSERT_EQ(keyframes.size(), 4U);
  const std::uint32_t parts[] = {0, 0, 2, 2}, frames[] = {2, 4, 8, 10};
  for (std::uint32_t k = 0; k < 4; ++k) {
    EXPECT_EQ(keyframes[k].id, k);
    EXPECT_EQ(keyframes[k].part, parts[k]);
    EXPECT_EQ(keyframes[k].frame, frames[k]);
  }
  EXPECT_EQ(path()[9].part, 2U);
  EXPECT_EQ(path()[9].reference, 2U);
  ASSERT_EQ(scene_.end_event(), 4U);
  EXPECT_EQ(scene_.event(0).part, 2U) << "where the camera was then";
  const auto edges = records<ViewEdge>(scene_, ViewBlock::kEdges);
  ASSERT_EQ(edges.size(), 3U);
  EXPECT_EQ(edges[1].key(), (ViewEdge{.from = 0, .to = 3}.key())) << "the loop's, which the graph has not";
  EXPECT_EQ(edges[1].loop, kJoinsParts);
  EXPECT_EQ(edges[2].key(), (ViewEdge{.from = 2, .to = 3}.key()));
  EXPECT_EQ(edges[2].marginalised, 1);
}

/// Whose times are of other recordings: some are those of this run's frames, and they need not ascend.
TEST_F(FinishedRunTest, KeyframesOfALoadedMapAreNoFramesOfThisRun) {
  write_tum_trajectory(folder_.path() / "keyframes_loaded.txt", poses({5, 3, 90}));
  folder_.write("edges.txt", "0 1 12 covisible\n2 3 5 covisible\n");
  write_frames();
  show();
  const auto keyframes = records<ViewKeyframe>(scene_, ViewBlock::kKeyframes);
  ASSERT_EQ(keyframes.size(), 7U);
  for (std::uint32_t k = 0; k < 3; ++k) {
    EXPECT_EQ(keyframes[k].id, k);
    EXPECT_EQ(keyframes[k].frame, kViewNotKnown);
    EXPECT_EQ(keyframes[k].t, 0) << "it was there from the first moment on";
  }
  EXPECT_EQ(keyframes[3].frame, 2U);
  EXPECT_EQ(path()[5].reference, 4U) << "keyframe 90 is of another recording";
  EXPECT_EQ(path()[5].keyframe, 0);
  const auto edges = records<ViewEdge>(scene_, ViewBlock::kEdges);
  EXPECT_TRUE(std::any_of(edges.begin(), edges.end(),
                          [](const ViewEdge& edge) { return edge.from == 2 && edge.to == 3; }));
  const auto points = records<ViewPoint>(scene_, ViewBlock::kPoints);
  EXPECT_EQ(points[0].anchor, 1U) << "lines of the loaded map's keyframes come first";
}

TEST_F(FinishedRunTest, AllKeyframesMayBeOfTheLoadedMap) {
  write_tum_trajectory(folder_.path() / "keyframes_loaded.txt", poses({50, 60}));
  write_tum_trajectory(folder_.path() / "keyframes.txt", {});
  show();
  EXPECT_EQ(path()[3].reference, 0U);
  EXPECT_EQ(path()[3].keyframe, 0);
}

TEST_F(FinishedRunTest, RelocalisationsAndNewPartsAreEvents) {
  show();
  ASSERT_EQ(scene_.end_event(), 4U);
  const ViewEvent& part = scene_.event(1);
  EXPECT_EQ(part.kind, "new part");
  EXPECT_EQ(part.frame, 8U);
  EXPECT_NEAR(part.t, 0.4, 1e-5);
  EXPECT_EQ(part.part_before, 0U) << "that of the pose before";
  EXPECT_EQ(part.part, 2U);
  EXPECT_EQ(part.after[0], 8);
  EXPECT_EQ(part.before, part.after) << "there is no way between the worlds of two parts";
  const ViewEvent& found = scene_.event(2);
  EXPECT_EQ(found.kind, "relocalisation");
  EXPECT_EQ(found.part_before, found.part);
  EXPECT_EQ(found.moved, 0.25);
  EXPECT_EQ(found.turned, 0.5);
  EXPECT_EQ(found.before[0], 9) << "where it was last";
  EXPECT_EQ(found.after[0], 10);
}

TEST_F(FinishedRunTest, PointsKnowWhenTheyWereFirstSeenAndHowWellTheyAreKnown) {
  show();
  const auto points = records<ViewPoint>(scene_, ViewBlock::kPoints);
  ASSERT_EQ(points.size(), 2U);
  EXPECT_EQ(points[0].anchor, 1U);
  EXPECT_EQ(points[0].observers, 5);
  EXPECT_EQ(points[0].deviation, deviation_code(0.125));
  EXPECT_EQ(points[1].anchor, 2U) << "keyframes of all parts are counted";
  EXPECT_EQ(points[1].part, 2U);
  EXPECT_TRUE(title_.has_deviations && title_.has_first_seen && title_.has_observers);
  EXPECT_FALSE(title_.metres);
}

TEST_F(FinishedRunTest, TimesAreThereIfTheRunLeftThem) {
  show();
  EXPECT_FALSE(title_.has_times);
  write_frames();
  scene_ = ViewScene();
  show();
  EXPECT_TRUE(title_.has_times);
  EXPECT_EQ(path()[3].latency_ms, 25.5F);
  EXPECT_EQ(path()[3].tracking_ms, 7.25F);
  EXPECT_EQ(path()[3].effort, 2);
}

TEST_F(FinishedRunTest, FilesThatMakeNoSenseAreNamed) {
  folder_.write("frames.txt", "0 5 tracked 1 1 0\n0 6 tracked 1 1 0\n");
  EXPECT_IO_ERROR(show(), "frames.txt: line 2 makes no sense");
  folder_.write("frames.txt", "0 5 asleep 1 1 0\n");
  EXPECT_IO_ERROR(show(), "line 1");
  std::filesystem::remove(folder_.path() / "frames.txt");
  folder_.write("edges-2.txt", "0 2 12 covisible\n");
  EXPECT_IO_ERROR(show(), "edges-2.txt");
  folder_.write("edges-2.txt", "0 1 12 covisible\n0 one 12 covisible\n");
  EXPECT_IO_ERROR(show(), "edges-2.txt: line 2 makes no sense");
  folder_.write("edges-2.txt", "");
  folder_.write("summary.json", R"({"source": 7})");
  EXPECT_IO_ERROR(show(), "summary.json: makes no sense");
}

}  // namespace
}  // namespace twofold
