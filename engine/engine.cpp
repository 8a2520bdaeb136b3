#include "engine/engine.hpp"

#include <stdexcept>

#include "engine/health.hpp"
#include "engine/lockstep_run.hpp"
#include "engine/threaded_run.hpp"

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

}  // namespace

void Progress::count(const FrameRecord& record) {
  ++frames;
  lost += record.state == FrameState::kLost;
  dropped += record.state == FrameState::kDropped;
  keyframes += record.keyframe;
  tracked_share = record.tracked_share;
}

LatencyHistogram exposure_to_pose(const RunResult& result) {
  LatencyHistogram latency;
  for (const FrameRecord& record : result.frames) {
    if (record.state != FrameState::kDropped) latency.record(record.latency_ns);
  }
  return latency;
}

void expect_valid(const Rig& rig, const EngineOptions& options) {
  if (const std::string reason = options.invalid_reason(); !reason.empty()) throw std::runtime_error(reason);
  if (options.map) {
    const std::string difference = options.localise_only ? localisation_difference(rig, options.map->rig)
                                                         : rig_difference(rig, options.map->rig);
    if (!difference.empty()) throw std::runtime_error("the map was made with another camera: " + difference);
    if (rig.kind != options.map->rig.kind && !options.localise_only)
      throw std::runtime_error("one camera can only be localised in the map of a stereo or RGB-D rig");
    if (!options.vocabulary)
      throw std::runtime_error("a camera finds itself in a map by recognition: a vocabulary is needed");
  }
  if (options.localise_only && !options.map)
    throw std::runtime_error("localisation only needs a map to localise in");
}

Engine::Engine(const Rig& rig, EngineOptions options) : rig_(rig), options_(std::move(options)) {
  expect_valid(rig_, options_);
}

RunResult Engine::run(const FrameFeed& feed, const std::atomic<bool>& interrupted,
                      const ProgressSink& progress) {
  const CostMeter cost;
  RunResult result;
  if (options_.deterministic) {
    LockstepRun run(rig_, options_);
    run.run(feed, interrupted, progress);
    result = run.finish();
  } else {
    ThreadedRun run(rig_, options_);
    run.run(feed, interrupted, progress);
    result = run.finish();
  }
  cost.finish(result);
  return result;
}

RunResult Engine::replay(const FrameFeed& feed, const Schedule& schedule,
                         const std::atomic<bool>& interrupted, const ProgressSink& progress) {
  const CostMeter cost;
  LockstepRun run(rig_, options_);
  run.replay(feed, schedule, interrupted, progress);
  RunResult result = run.finish();
  cost.finish(result);
  return result;
}

}  // namespace twofold
