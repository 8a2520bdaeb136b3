#include "slam/summary.hpp"

#include <nlohmann/json.hpp>

#include "slam/conversions.hpp"

namespace twofold {
namespace {

void add_timings(const StageRecorder& thread, std::vector<StageTime>& timings) {
  const nlohmann::json stages = thread.to_json();
  for (const auto& [stage, times] : stages.items()) {
    timings.push_back({thread.thread_name(), stage, times["count"], times["mean_ms"], times["p50_ms"],
                       times["p99_ms"], times["max_ms"]});
  }
}

}  // namespace

SlamSummary summarise(const RunResult& result) {
  SlamSummary summary;
  summary.frames = static_cast<std::int64_t>(result.frames.size());
  for (const FrameRecord& record : result.frames) {
    summary.lost += record.state == FrameState::kLost;
    summary.dropped += record.state == FrameState::kDropped;
    summary.tracked += record.state == FrameState::kTracked;
    summary.placed_later += record.state == FrameState::kPlacedLater;
    if (!has_final_pose(record)) continue;
    // A keyframe the mapper never got to leaves its frames without a place in the map.
    if (!result.graph.contains(record.reference)) continue;
    summary.trajectory.push_back({record.t_ns, index(result.graph.part(record.reference)),
                                  to_pose(final_T_c_w(record, result.graph).inverse())});
  }
  for (const StageRecorder& thread : result.times) add_timings(thread, summary.timings);
  summary.notes = result.notes;
  if (!result.error.empty()) summary.errors.push_back(result.error);
  return summary;
}

}  // namespace twofold
