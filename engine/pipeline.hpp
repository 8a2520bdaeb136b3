#pragma once

#include <chrono>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "camera/frame.hpp"
#include "camera/rig.hpp"
#include "engine/logs/schedule_log.hpp"
#include "engine/options.hpp"
#include "engine/result.hpp"

namespace twofold {

/// How much waits for tracker, mapper and loop closer. For users: QueueLengths.
struct WaitingCounts {
  std::size_t frames = 0;     ///< for the tracker
  std::size_t keyframes = 0;  ///< proposals, for the mapper
  std::size_t places = 0;     ///< keyframes, for the loop closer
};

/// State of a run for a progress line.
struct Progress {
  std::int64_t frames = 0;
  std::int64_t lost = 0;
  std::int64_t dropped = 0;
  double tracked_share = 0;  ///< of the last frame
  std::uint64_t map_version = 0;
  std::int64_t keyframes = 0;  ///< accepted so far
  WaitingCounts waiting;       ///< a lockstep run's: keyframes only

  /// Another frame is done with.
  void count(const FrameRecord& record);
};

/// Takes a frame that is done with, and the correction of the map that was seen first by it, if any.
using FrameSink = std::function<void(const FrameRecord&, const PoseCorrection&)>;

/// Of EngineOptions::stepped: what the caller's threads do by turns.
enum class PipelineStep : std::uint8_t {
  kTrack,      ///< the oldest frame that waits
  kMap,        ///< a round of the mapper over the keyframes and loops that wait
  kCloseLoops  ///< the oldest request of a lost camera, else the oldest keyframe that waits
};

/// Tracker, mapper and loop closer, given one frame at a time. What differs between its kinds is who decides
/// the order of their steps: three threads and the clock (ThreadedRun), the caller's threads (SteppedRun),
/// one fixed order or that of a log (LockstepRun).
///
/// Calls are made by one thread at a time, unless they say otherwise. None but wait, stop and finish blocks,
/// and, where steps are taken by the calling thread, push.
class Pipeline {
 public:
  Pipeline() = default;
  Pipeline(const Pipeline&) = delete;
  Pipeline& operator=(const Pipeline&) = delete;
  virtual ~Pipeline() = default;

  /// Whether there is a buffer for a frame. Buffers are given back by collect.
  [[nodiscard]] virtual bool has_buffer() = 0;
  /// Whether another frame should be pushed now: there is a buffer, and a run that keeps no pace, whose
  /// frames come as fast as they are tracked, is not ahead of the mapper or of the thread that writes its
  /// logs.
  [[nodiscard]] virtual bool has_room() = 0;
  /// Hands a frame to the tracker; there must be a buffer. Frame::index and time stamps grow.
  virtual void push(Frame frame) = 0;
  /// Takes back the frames that are done with, in the order they were pushed. The arguments of `sink`, which
  /// may be empty, are valid during the call only.
  virtual void collect(const FrameSink& sink) = 0;
  /// Sleeps until a frame can be collected, or there is room where there was none; not beyond `deadline`.
  virtual void wait(std::chrono::steady_clock::time_point deadline) = 0;
  /// A step has failed: what is pushed now is not tracked, and RunResult::error says why.
  [[nodiscard]] virtual bool failed() const = 0;
  /// It failed, or is a replay whose schedule has no more frames.
  [[nodiscard]] virtual bool ended() const { return failed(); }
  /// Of a replay: frames that the schedule has beyond those pushed.
  [[nodiscard]] virtual std::size_t frames_due() const { return 0; }
  /// Of a stepped run: takes that step. Any thread; different steps at once if the caller likes. What it
  /// throws comes out, and the run has failed.
  /// @return false: there was nothing to do, or another thread is at it
  [[nodiscard]] virtual bool step(PipelineStep) { return false; }

  /// What the run's logs have lost so far, as on a disk that is full: a sentence a file. Any thread.
  [[nodiscard]] virtual std::vector<std::string> log_errors() const = 0;
  /// Why the newest checkpoint could not be written; empty: it could, or there was none yet. Any thread.
  [[nodiscard]] virtual std::string checkpoint_error() const = 0;
  /// Counts of what was collected.
  [[nodiscard]] virtual const Progress& progress() const = 0;
  /// Any thread, wait-free: no more than a look at the rings.
  [[nodiscard]] virtual WaitingCounts waiting() const { return {}; }

  /// From now on nobody waits for the exposure of a frame that was pushed. Any thread.
  virtual void end_pace() {}
  /// No more frames: returns when all that were pushed have been tracked and mapped. They can still be
  /// collected.
  virtual void stop() = 0;
  /// After stop: collects what was not, and optimises the whole pose graph; moves the result out.
  [[nodiscard]] virtual RunResult finish() = 0;
};

/// Throws std::runtime_error when an option is invalid, or does not go with the rig, naming it.
void expect_valid(const Rig& rig, const EngineOptions& options);

/// Threaded, stepped or deterministic, as `options` say. Throws as expect_valid.
[[nodiscard]] std::unique_ptr<Pipeline> make_pipeline(const Rig& rig, const EngineOptions& options);
/// Repeats the run that wrote `schedule` over the same frames: same steps, same bytes. Throws as
/// expect_valid.
[[nodiscard]] std::unique_ptr<Pipeline> make_replay(const Rig& rig, const EngineOptions& options,
                                                    Schedule schedule);

}  // namespace twofold
