#include "engine/replacement_log.hpp"

#include <vector>

#include "geometry/check.hpp"
#include "graph/id_map.hpp"

namespace twofold {

void ReplacementLog::add(KeyframeId culled, const GraphSnapshot& graph) {
  const Replacement& replacement = graph.replacement(culled);
  TWOFOLD_CHECK(graph.keyframe(culled).culled() && replacement.id != kNoKeyframe, "culled a moment ago");
  entries_.push_back({culled, replacement.id, replacement.T_this_replacement});
}

void ReplacementLog::hang_on_live_keyframes(ChunkedVector<FrameRecord>& frames) const {
  // A replacement that was culled too was culled later: from the newest entry back, the keyframe that stands
  // for a replacement is known already.
  std::vector<GraphSnapshot::LiveReplacement> live(entries_.size());
  IdMap position;
  for (std::size_t n = entries_.size(); n-- > 0;) {
    const Entry& entry = entries_[n];
    live[n] = {entry.replacement, entry.T_id_replacement.unpacked()};
    if (const int at = position.find(entry.replacement); at >= 0) {
      const auto& [id, T_replacement_live] = live[static_cast<std::size_t>(at)];
      live[n] = {id, live[n].T_this_live * T_replacement_live};
    }
    position.set(entry.id, static_cast<int>(n));
  }
  for (std::size_t n = 0; n < frames.size(); ++n) {
    FrameRecord& frame = frames[n];
    const int at = position.find(frame.reference);
    if (at < 0) continue;
    const auto& [id, T_ref_live] = live[static_cast<std::size_t>(at)];
    frame.reference = id;
    frame.T_c_ref = PackedPose(frame.T_c_ref.unpacked() * T_ref_live);
  }
}

}  // namespace twofold
