#pragma once

#include <atomic>
#include <functional>

#include "camera/frame.hpp"
#include "camera/rig.hpp"
#include "engine/options.hpp"
#include "engine/result.hpp"

namespace twofold {

enum class FeedStatus : std::uint8_t { kFrame, kEnd, kError };
/// Fills the next frame. The engine keeps the images as long as it needs them: nobody writes into them again.
using FrameFeed = std::function<FeedStatus(Frame&)>;

/// State of a run for a progress line.
struct Progress {
  std::int64_t frames = 0;
  std::int64_t lost = 0;
  std::int64_t dropped = 0;
  double tracked_share = 0;  ///< of the last frame
  std::uint64_t map_version = 0;
  std::int64_t keyframes = 0;      ///< accepted so far
  std::size_t queued = 0;          ///< proposals waiting for the mapper
  std::size_t frames_waiting = 0;  ///< for the tracker
  std::size_t places_waiting = 0;  ///< keyframes, for the loop closer

  /// Another frame is done with.
  void count(const FrameRecord& record);
};
using ProgressSink = std::function<void(const Progress&)>;

/// Throws std::runtime_error when an option is invalid, or does not go with the rig, naming it.
void expect_valid(const Rig& rig, const EngineOptions& options);

/// Runs tracker, mapper and loop closer over a stream of frames, in one of three ways that differ only in who
/// decides the order of steps: three threads and the clock; one thread and one fixed order
/// (EngineOptions::deterministic); or one thread and the order that a threaded run left in its schedule log.
class Engine {
 public:
  /// Throws as expect_valid.
  Engine(const Rig& rig, EngineOptions options);

  /// Returns when the feed ends, `interrupted` becomes true, or a thread fails (RunResult::error). In each
  /// case the result holds all that was tracked and mapped so far. `feed` and `progress` are called on this
  /// thread.
  [[nodiscard]] RunResult run(const FrameFeed& feed, const std::atomic<bool>& interrupted,
                              const ProgressSink& progress = {});

  /// Repeats the run that wrote `schedule` over the same frames: same steps, same bytes. RunResult::error
  /// says so when frames and schedule do not fit together.
  [[nodiscard]] RunResult replay(const FrameFeed& feed, const Schedule& schedule,
                                 const std::atomic<bool>& interrupted, const ProgressSink& progress = {});

 private:
  Rig rig_;
  EngineOptions options_;
};

}  // namespace twofold
