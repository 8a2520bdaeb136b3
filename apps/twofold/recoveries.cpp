#include "apps/twofold/recoveries.hpp"

#include <set>

namespace twofold {
namespace {

std::optional<SE3> T_last_now(const FrameRecord& last, const FrameRecord& now, const GraphSnapshot& graph) {
  const bool together = has_final_pose(last, graph) && has_final_pose(now, graph) &&
                        graph.part(last.reference) == graph.part(now.reference);
  if (!together) return std::nullopt;
  return final_T_c_w(last, graph) * final_T_c_w(now, graph).inverse();
}

}  // namespace

std::vector<Recovery> recoveries(const RunResult& result, std::uint32_t loaded_keyframes) {
  std::vector<Recovery> found;
  std::set<KeyframeId> known;  // parts that a frame was in; their names go when they join older ones
  FrameRecord last;            // tracked; of state kLost before the first
  int lost = 0;
  for (const FrameRecord& record : result.frames) {
    if (record.state == FrameState::kDropped) continue;  // nobody tried to place it
    if (record.state != FrameState::kTracked) {
      ++lost;
      continue;
    }
    const bool is_loaded = index(record.part_causal) < loaded_keyframes;
    const bool is_new = known.insert(record.part_causal).second && !is_loaded;
    const bool is_first_map = is_new && known.size() == 1 && loaded_keyframes == 0;
    if (lost > 0 && !is_first_map)
      found.push_back(
          {record.frame_index, record.t_ns, lost, is_new, T_last_now(last, record, result.graph)});
    last = record;
    lost = 0;
  }
  return found;
}

}  // namespace twofold
