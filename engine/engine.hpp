#pragma once

#include <atomic>
#include <functional>

#include "camera/frame.hpp"
#include "camera/rig.hpp"
#include "engine/pipeline.hpp"

namespace twofold {

/// Fills the next frame. The engine keeps the images as long as it needs them: nobody writes into them again.
using FrameFeed = std::function<FrameStatus(Frame&)>;

using ProgressSink = std::function<void(const Progress&)>;

/// Feeds a pipeline from a source until that ends, `interrupted` becomes true or the pipeline takes no more,
/// and finishes it. Not a stepped one, which nobody would step meanwhile.
[[nodiscard]] RunResult feed_all(Pipeline& pipeline, const FrameFeed& feed,
                                 const std::atomic<bool>& interrupted, const ProgressSink& progress = {});

/// Runs tracker, mapper and loop closer (engine/pipeline.hpp) over a stream of frames.
class Engine {
 public:
  /// options: not `stepped`. Throws as expect_valid.
  Engine(const Rig& rig, EngineOptions options);

  /// Returns when the feed ends, `interrupted` becomes true, or a thread fails (RunResult::error). In each
  /// case the result holds all that was tracked and mapped so far. `feed` and `progress` are called on this
  /// thread.
  [[nodiscard]] RunResult run(const FrameFeed& feed, const std::atomic<bool>& interrupted,
                              const ProgressSink& progress = {});

  /// Repeats the run that wrote `schedule` over the same frames: same steps, same bytes. RunResult::error
  /// says so when frames and schedule do not fit together.
  [[nodiscard]] RunResult replay(const FrameFeed& feed, Schedule schedule,
                                 const std::atomic<bool>& interrupted, const ProgressSink& progress = {});

 private:
  Rig rig_;
  EngineOptions options_;
};

}  // namespace twofold
