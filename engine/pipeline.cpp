#include "engine/pipeline.hpp"

#include <stdexcept>

#include "engine/lockstep_run.hpp"
#include "engine/threaded_run.hpp"

namespace twofold {

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

std::unique_ptr<Pipeline> make_pipeline(const Rig& rig, const EngineOptions& options) {
  expect_valid(rig, options);
  if (options.deterministic) return std::make_unique<LockstepRun>(rig, options);
  if (options.stepped) return std::make_unique<SteppedRun>(rig, options);
  return std::make_unique<ThreadedRun>(rig, options);
}

std::unique_ptr<Pipeline> make_replay(const Rig& rig, const EngineOptions& options, Schedule schedule) {
  expect_valid(rig, options);
  return std::make_unique<LockstepRun>(rig, options, std::move(schedule));
}

}  // namespace twofold
