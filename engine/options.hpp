#pragma once

#include <atomic>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <limits>
#include <memory>
#include <optional>
#include <string>
#include <string_view>

#include "base/right_of_way.hpp"
#include "engine/effort_controller.hpp"
#include "engine/pacing.hpp"
#include "graph/map_file.hpp"
#include "loopclosure/loop_closer.hpp"
#include "mapping/mapper.hpp"
#include "tracking/common/placement.hpp"
#include "tracking/options.hpp"

namespace twofold {

struct PoseReport;
struct ClosedLoop;

/// Told of each frame that was looked at, tracked or lost. Called on the thread of the tracker, which goes on
/// when it returns: it must not block, allocate or throw. Its time is a stage of its own ("pose listener",
/// "frame listener").
using PoseListener = std::function<void(const PoseReport&)>;

/// Told of each version of the map, and of the windows it was made in; valid during the call only, but for
/// copies of the graph. Called on the mapper's thread, which waits for it, and where the run is made and
/// finished.
using MapListener = std::function<void(const GraphSnapshot& graph, const DoubleWindow& window)>;
/// The same for how places look, on the loop closer's thread.
using PlacesListener = std::function<void(const KeyframeDatabase& places)>;
/// Told of each loop that the mapper is told of, just before: on the loop closer's thread, too.
using LoopListener = std::function<void(const ClosedLoop& loop)>;

/// The map as it stands, saved again and again during a run.
struct CheckpointOptions {
  std::filesystem::path file;
  double period = 0;  ///< [s] >= 0; 0: none. By the clock; in runs on one thread by the frames' time stamps

  /// Empty when valid; otherwise names the field, the rule and the value.
  [[nodiscard]] std::string invalid_reason() const;
};

/// Where a run takes down what it leaves behind (engine/logs/run_logs.hpp).
struct RunLogOptions {
  /// There must be one: trajectory_causal.txt, schedule.log and the records of frames grow in it. Empty: all
  /// stays in memory.
  std::filesystem::path folder;
  /// Without a folder: at least so many of the newest frames are kept, >= 1; 176 bytes each.
  std::size_t frames_in_memory = std::numeric_limits<std::size_t>::max();

  /// Empty when valid; otherwise names the field, the rule and the value.
  [[nodiscard]] std::string invalid_reason() const;
};

struct EngineOptions {
  TrackerOptions tracker;
  MapperOptions mapper;
  LoopCloserOptions loop_closer;
  /// Words that places are recognised by; null: no loop is closed by appearance, no lost camera finds itself.
  std::shared_ptr<const Vocabulary> vocabulary;

  /// Map to go on with, in which the camera must first be recognised; null: the run starts one. Not destroyed
  /// before the run has ended.
  std::shared_ptr<const SavedMap> map;
  /// Where in `map` the camera is looked for from the first frame on, beside recognition; none where there is
  /// no map.
  std::optional<AssumedPose> assumed_pose;
  bool localise_only = false;  ///< no keyframe is made: `map`, which must be there, does not change
  /// While true no keyframe is made: the map stays as it is, until it is false again. May be null; outlives
  /// the run. A replay takes it from its log.
  const std::atomic<bool>* mapping_paused = nullptr;
  CheckpointOptions checkpoint;
  RunLogOptions logs;

  /// One thread, one order: each frame is tracked against the map with every earlier keyframe optimised.
  bool deterministic = false;
  /// No threads: the caller's take the steps (Pipeline::step). No checkpoints then.
  bool stepped = false;
  PacingOptions pacing{.speed = 0};  ///< of threaded and stepped runs
  EffortOptions effort;              ///< likewise, if they keep a pace

  std::size_t frame_slots = 8;  ///< frames decoded ahead, or waiting, at most, >= 1
  /// Proposals waiting for the mapper, and keyframes for the loop closer, at most; rounded up to a power of
  /// two, in [1, 16]: while a proposal waits, so many others may cull keyframes, and the map still knows what
  /// replaced its reference (CullingOptions::keep_replacements).
  std::size_t proposal_slots = 4;

  std::optional<int> tracker_cpu;  ///< pin the threads to these, >= 0
  std::optional<int> mapper_cpu;
  std::optional<int> loop_closer_cpu;
  std::optional<int> fifo_priority;  ///< SCHED_FIFO for the tracker, in [1, 99]

  /// Taken by the tracker's step from when a frame is due until it is done, in threaded and stepped runs that
  /// keep a pace: threads of the caller's that can wait make way for it (MakesWay). Of one engine; may be
  /// null; outlives the run.
  RightOfWay* right_of_way = nullptr;

  PoseListener on_pose;   ///< as soon as the pose is known; may be empty
  PoseListener on_frame;  ///< once the tracker is done with the frame, all stages timed; may be empty
  /// A new version of the map is made, and nobody can see it yet: what must be known by then is worked out
  /// here. Its time is a stage of its own ("map listener"). May be empty.
  MapListener on_next_map;
  MapListener on_map;        ///< it is published, and readers wait for it meanwhile; may be empty
  PlacesListener on_places;  ///< what the loop closer has described; may be empty
  LoopListener on_loop;      ///< a loop was closed by appearance; may be empty

  /// For tests of failures: called by the thread of that name ("tracker", "mapper", "loop closer",
  /// "checkpoints") of a threaded run before each of its steps, which fails with what this throws.
  std::function<void(std::string_view thread)> before_step;

  bool trace = false;  ///< keep spans and counters for RunResult::trace

  /// Empty when valid; otherwise names the field, the rule and the value.
  [[nodiscard]] std::string invalid_reason() const;
};

}  // namespace twofold
