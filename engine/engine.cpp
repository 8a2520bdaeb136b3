#include "engine/engine.hpp"

#include "engine/health.hpp"

namespace twofold {
namespace {

/// What the run itself cost, beside what the process had used before.
class CostMeter {
 public:
  void finish(RunResult& result) const {
    const ProcessUsage usage = process_usage();
    result.cpu_seconds = usage.cpu_seconds - start_.cpu_seconds;
    result.peak_rss_mb = static_cast<double>(usage.peak_rss_bytes) / (1024.0 * 1024.0);
    result.wall_seconds = static_cast<double>(steady_now_ns() - start_ns_) * 1e-9;
  }

 private:
  ProcessUsage start_ = process_usage();
  std::int64_t start_ns_ = steady_now_ns();
};

/// False when the pipeline takes no more, or the run is interrupted.
bool wait_for_room(Pipeline& pipeline, const std::atomic<bool>& interrupted, const FrameSink& sink) {
  constexpr auto kFailureCheck = std::chrono::milliseconds(50);  // a thread that failed wakes nobody
  // Relaxed: the flag carries no other data; seeing it later is as good.
  while (!interrupted.load(std::memory_order_relaxed)) {
    pipeline.collect(sink);
    if (pipeline.ended()) return false;
    if (pipeline.has_room()) return true;
    pipeline.wait(std::chrono::steady_clock::now() + kFailureCheck);
  }
  return false;
}

/// Returns when all frames that were pushed are done with, or none will be, or the run is interrupted.
void play_out(Pipeline& pipeline, std::int64_t pushed, const std::atomic<bool>& interrupted,
              const FrameSink& sink) {
  constexpr auto kCheck = std::chrono::milliseconds(50);
  while (!interrupted.load(std::memory_order_relaxed) && !pipeline.ended()) {
    pipeline.collect(sink);
    if (pipeline.progress().frames >= pushed) return;
    pipeline.wait(std::chrono::steady_clock::now() + kCheck);
  }
}

}  // namespace

RunResult feed_all(Pipeline& pipeline, const FrameFeed& feed, const std::atomic<bool>& interrupted,
                   const ProgressSink& progress) {
  const FrameSink show = [&](const FrameRecord&, const PoseCorrection&) {
    if (progress) progress(pipeline.progress());
  };
  FrameStatus status = FrameStatus::kFrame;
  Frame frame;
  std::int64_t pushed = 0;
  while (wait_for_room(pipeline, interrupted, show) && (status = feed(frame)) == FrameStatus::kFrame) {
    pipeline.push(std::move(frame));
    ++pushed;
  }
  play_out(pipeline, pushed, interrupted, show);
  if (interrupted.load(std::memory_order_relaxed)) pipeline.end_pace();
  const bool input_is_short = status == FrameStatus::kEnd && pipeline.frames_due() > 0;
  pipeline.stop();
  pipeline.collect(show);
  RunResult result = pipeline.finish();
  result.interrupted = interrupted.load(std::memory_order_relaxed);
  if (status == FrameStatus::kError) result.error = "the input ended with an error";
  if (input_is_short && !result.interrupted) result.error = "the schedule has more frames than the input";
  return result;
}

Engine::Engine(const Rig& rig, EngineOptions options) : rig_(rig), options_(std::move(options)) {
  expect_valid(rig_, options_);
}

RunResult Engine::run(const FrameFeed& feed, const std::atomic<bool>& interrupted,
                      const ProgressSink& progress) {
  const CostMeter cost;
  const std::unique_ptr<Pipeline> pipeline = make_pipeline(rig_, options_);
  RunResult result = feed_all(*pipeline, feed, interrupted, progress);
  cost.finish(result);
  return result;
}

RunResult Engine::replay(const FrameFeed& feed, Schedule schedule, const std::atomic<bool>& interrupted,
                         const ProgressSink& progress) {
  const CostMeter cost;
  const std::unique_ptr<Pipeline> pipeline = make_replay(rig_, options_, std::move(schedule));
  RunResult result = feed_all(*pipeline, feed, interrupted, progress);
  cost.finish(result);
  return result;
}

}  // namespace twofold
