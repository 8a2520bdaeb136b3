#include <gtest/gtest.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <fstream>
#include <iterator>

#include "loopclosure/default_vocabulary.hpp"
#include "tests/engine/run_checks.hpp"

namespace twofold {
namespace {

using testing::render_walk;
using testing::run_engine;
using testing::small_rig;
constexpr auto T_c_w = testing::turning_walk;

/// A camera that turns by 90 degrees in a textured room: the first part is mapped and saved, later runs start
/// elsewhere.
class EngineMapTest : public ::testing::Test {
 protected:
  static constexpr int kFrames = 60;
  static constexpr int kMapped = 45;

  static void SetUpTestSuite() {
    room_ = new std::vector<Frame>(render_walk(T_c_w, 0, kFrames, 5));
    map_ = new std::shared_ptr<const SavedMap>;
    const RunResult result = run_engine(options(), frames(0, kMapped));
    *map_ = std::make_shared<const SavedMap>(SavedMap{small_rig(), result.graph, result.places});
  }
  static void TearDownTestSuite() {
    delete room_;
    delete map_;
  }

  /// Frames [begin, end) of the walk through the mapped room, numbered from 0.
  static FrameFeed frames(int begin, int end) {
    return [begin, end, next = begin](Frame& frame) mutable {
      if (next == end) return FrameStatus::kEnd;
      frame = (*room_)[static_cast<std::size_t>(next)];
      testing::number_frame(frame, next - begin);
      ++next;
      return FrameStatus::kFrame;
    };
  }

  static EngineOptions options() {
    EngineOptions options;
    options.deterministic = true;
    options.vocabulary = std::make_shared<const Vocabulary>(load_default_vocabulary());
    return options;
  }
  /// What a later process would find.
  static EngineOptions options_with_map(bool localise_only) {
    EngineOptions with_map = options();
    with_map.map = *map_;
    with_map.localise_only = localise_only;
    return with_map;
  }

  /// Poses are in the loaded map's frame, that of its first keyframe.
  static void expect_tracked_from(const RunResult& result, int first, int shown_first) {
    for (const FrameRecord& record : result.frames) {
      const auto i = static_cast<int>(record.frame_index);
      if (i < first) {
        EXPECT_EQ(record.state, FrameState::kLost) << i;
        continue;
      }
      ASSERT_EQ(record.state, FrameState::kTracked) << i << ": " << describe(record.cause);
      const SE3 T_c_first_true = T_c_w(shown_first + i) * T_c_w(0).inverse();
      EXPECT_LT(testing::position_error(record, result.graph, T_c_first_true), 0.03) << i;
    }
  }
  static std::string bytes_of(const SavedMap& map) {
    const auto file = std::filesystem::temp_directory_path() /
                      ("twofold_engine_map_test_" + std::to_string(::getpid()) + ".tfm");
    save_map(file, map);
    std::ifstream in(file, std::ios::binary);
    std::string bytes{std::istreambuf_iterator<char>(in), {}};
    std::filesystem::remove(file);
    return bytes;
  }

  static std::vector<Frame>* room_;
  static std::shared_ptr<const SavedMap>* map_;
};

std::vector<Frame>* EngineMapTest::room_ = nullptr;
std::shared_ptr<const SavedMap>* EngineMapTest::map_ = nullptr;

TEST_F(EngineMapTest, ALoadedMapIsRecognisedAndGoesOn) {
  constexpr int kFirst = 20;
  const RunResult result = run_engine(options_with_map(false), frames(kFirst, kFrames));
  ASSERT_EQ(result.error, "");
  expect_tracked_from(result, 1, kFirst);
  const GraphSnapshot& before = (*map_)->graph;
  ASSERT_GT(result.graph.keyframe_count(), before.keyframe_count());
  EXPECT_GE(result.graph.point_count(), before.point_count());
  bool joined = false;  // what is new hangs on what was loaded
  for (std::uint32_t k = 0; k < result.graph.keyframe_count(); ++k) {
    EXPECT_EQ(result.graph.keyframe(KeyframeId{k}).id, KeyframeId{k});
    if (k < before.keyframe_count()) {
      EXPECT_EQ(result.graph.keyframe(KeyframeId{k}).t_ns, before.keyframe(KeyframeId{k}).t_ns);
      continue;
    }
    for (const Edge& edge : *result.graph.keyframe(KeyframeId{k}).edges)
      joined |= index(edge.other) < before.keyframe_count();
  }
  EXPECT_TRUE(joined);
  EXPECT_GT(result.places.size(), before.keyframe_count());
}

TEST_F(EngineMapTest, LocalisingChangesNothing) {
  const std::string before = bytes_of(**map_);
  const RunResult result = run_engine(options_with_map(true), frames(10, kMapped));
  ASSERT_EQ(result.error, "");
  expect_tracked_from(result, 1, 10);
  for (const FrameRecord& record : result.frames) EXPECT_FALSE(record.keyframe);
  EXPECT_EQ(result.mapping.rounds, 0);
  // The head of the file tells the version, which is another; all that follows is the same.
  EXPECT_EQ(result.graph.keyframe_count(), (*map_)->graph.keyframe_count());
  for (std::uint32_t k = 0; k < result.graph.keyframe_count(); ++k) {
    EXPECT_EQ(result.graph.T_k_w(KeyframeId{k}).matrix(), (*map_)->graph.T_k_w(KeyframeId{k}).matrix());
  }
  EXPECT_EQ(bytes_of(**map_), before);
}

TEST_F(EngineMapTest, TheSameRunsGiveTheSameBytes) {
  for (const bool localise_only : {false, true}) {
    const RunResult a = run_engine(options_with_map(localise_only), frames(20, kFrames));
    const RunResult b = run_engine(options_with_map(localise_only), frames(20, kFrames));
    EXPECT_EQ(bytes_of({small_rig(), a.graph, a.places}), bytes_of({small_rig(), b.graph, b.places}));
    ASSERT_EQ(a.frames.size(), b.frames.size());
    for (std::size_t i = 0; i < a.frames.size(); ++i) {
      EXPECT_EQ(a.frames[i].T_c_w_causal, b.frames[i].T_c_w_causal) << i;
    }
  }
}

/// Without a clock to keep, no frame passes while the loop closer looks up where the lost camera is.
TEST_F(EngineMapTest, AThreadedRunInALoadedMapLosesNoFramesAndReplays) {
  for (const bool localise_only : {false, true}) {
    EngineOptions threaded = options_with_map(localise_only);
    threaded.deterministic = false;
    const int end = localise_only ? kMapped : kFrames;  // beyond, the map grows or ends
    const RunResult live = run_engine(threaded, frames(20, end));
    ASSERT_EQ(live.error, "");
    EXPECT_GE(live.recognised, 1);
    expect_tracked_from(live, 1, 20);
    const RunResult replayed = testing::expect_replay(threaded, frames(20, end), live);
    EXPECT_EQ(bytes_of({small_rig(), live.graph, live.places}),
              bytes_of({small_rig(), replayed.graph, replayed.places}));
  }
}

TEST_F(EngineMapTest, WhileMappingIsPausedTheMapGetsNoKeyframes) {
  constexpr int kPausedFrom = 15;
  std::atomic<bool> paused{false};
  EngineOptions threaded = options();
  threaded.deterministic = false;
  const auto keyframes_after = [](const RunResult& result) {
    return std::count_if(result.frames.begin(), result.frames.end(), [](const FrameRecord& record) {
      return record.keyframe && record.frame_index >= kPausedFrom;
    });
  };
  EXPECT_GT(keyframes_after(run_engine(threaded, frames(0, kFrames))), 0);
  threaded.mapping_paused = &paused;
  const FrameFeed feed = [&, next = frames(0, kFrames)](Frame& frame) {
    const FrameStatus status = next(frame);
    if (frame.index == kPausedFrom) paused = true;
    return status;
  };
  const RunResult result = run_engine(threaded, feed);
  ASSERT_EQ(result.error, "");
  EXPECT_EQ(keyframes_after(result), 0);
  (void)testing::expect_replay(threaded, frames(0, kFrames), result);
}

TEST_F(EngineMapTest, InAnotherRoomNothingIsRecognised) {
  const std::vector<Frame> elsewhere = render_walk(T_c_w, 10, 22, 77);
  for (const bool localise_only : {false, true}) {
    const FrameFeed feed = [&, next = std::size_t{0}](Frame& frame) mutable {
      if (next == elsewhere.size()) return FrameStatus::kEnd;
      frame = elsewhere[next];
      testing::number_frame(frame, static_cast<int>(next++));
      return FrameStatus::kFrame;
    };
    const RunResult result = run_engine(options_with_map(localise_only), feed);
    ASSERT_EQ(result.error, "");
    const std::size_t loaded = (*map_)->graph.keyframe_count();
    for (const FrameRecord& record : result.frames) {
      EXPECT_FALSE(record.state == FrameState::kTracked && index(record.reference) < loaded)
          << record.frame_index;
      if (localise_only) {
        EXPECT_EQ(record.state, FrameState::kLost);
      }
    }
  }
}

TEST_F(EngineMapTest, AMapOfAnotherCameraIsRefused) {
  Rig other = small_rig();
  other.baseline = 0.2;
  try {
    Engine engine(other, options_with_map(false));
    FAIL() << "taken";
  } catch (const std::runtime_error& error) {
    EXPECT_NE(std::string(error.what()).find("baseline is 0.2, the map's is 0.12"), std::string::npos);
  }
}

TEST_F(EngineMapTest, CheckpointsAreMapsThatLoad) {
  const auto file = std::filesystem::temp_directory_path() /
                    ("twofold_checkpoint_test_" + std::to_string(::getpid()) + ".tfm");
  for (const bool deterministic : {true, false}) {
    EngineOptions with_checkpoints = options();
    with_checkpoints.deterministic = deterministic;
    with_checkpoints.pacing.speed = 1;
    with_checkpoints.checkpoint = {file, deterministic ? 0.5 : 0.05};
    // Each is loaded while the run goes on: at any time there is none or a whole one.
    std::size_t largest = 0;
    int loaded = 0;
    const FrameFeed feed = [&, next = frames(0, kFrames)](Frame& frame) {
      if (std::filesystem::exists(file)) {
        const SavedMap map = load_map(file);
        EXPECT_GE(map.graph.keyframe_count(), largest);
        largest = map.graph.keyframe_count();
        ++loaded;
      }
      return next(frame);
    };
    const RunResult result = run_engine(with_checkpoints, feed);
    EXPECT_EQ(result.error, "");
    EXPECT_EQ(result.checkpoints.error, "");
    EXPECT_GT(result.checkpoints.saved, deterministic ? 2 : 1);
    EXPECT_GT(loaded, 0);
    const SavedMap last = load_map(file);
    EXPECT_GT(last.places.size(), 0U);
    std::filesystem::remove(file);
  }
}

TEST_F(EngineMapTest, ACheckpointThatCannotBeWrittenEndsNoRun) {
  EngineOptions with_checkpoints = options();
  with_checkpoints.checkpoint = {"/proc/no/such/folder/map.tfm", 0.5};
  const RunResult result = run_engine(with_checkpoints, frames(0, 40));
  EXPECT_EQ(result.error, "");
  EXPECT_EQ(result.checkpoints.saved, 0);
  EXPECT_NE(result.checkpoints.error.find("cannot be opened"), std::string::npos);
  EXPECT_EQ(result.frames.size(), 40U);
}

}  // namespace
}  // namespace twofold
