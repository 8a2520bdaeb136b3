#include "slam/summary.hpp"

#include <algorithm>
#include <map>

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
  summary.frames = result.counts.frames;
  summary.tracked = result.counts.tracked;
  summary.placed_later = result.counts.placed_later;
  summary.lost = result.counts.lost;
  summary.dropped = result.counts.dropped;
  for (const FrameRecord& record : result.frames) {
    if (!has_final_pose(record, result.graph)) continue;
    summary.poses.push_back({record.t_ns, index(result.graph.part(record.reference)),
                             to_pose(final_T_c_w(record, result.graph).inverse())});
  }
  summary.row_offset = result.row_offset;
  if (result.readout && result.readout->pairs > 1)
    summary.readout = {result.readout->significant, result.readout->seconds, result.readout->sigma,
                       static_cast<int>(result.readout->pairs)};
  for (const StageRecorder& thread : result.times) add_timings(thread, summary.timings);
  summary.notes = result.notes;
  return summary;
}

std::vector<StampedPose> SlamSummary::trajectory(std::uint32_t map_part) const {
  std::vector<StampedPose> trajectory;
  for (const FinalPose& pose : poses)
    if (pose.map_part == map_part) trajectory.push_back({pose.t_ns, pose.T_world_camera});
  return trajectory;
}

std::vector<StampedPose> SlamSummary::trajectory() const {
  std::map<std::uint32_t, std::size_t> counts;
  for (const FinalPose& pose : poses) ++counts[pose.map_part];
  const auto fewer = [](const auto& a, const auto& b) { return a.second < b.second; };
  const auto largest = std::max_element(counts.begin(), counts.end(), fewer);
  return largest == counts.end() ? std::vector<StampedPose>{} : trajectory(largest->first);
}

}  // namespace twofold
