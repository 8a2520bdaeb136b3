#include "engine/lineage.hpp"

#include "geometry/check.hpp"
#include "graph/id_map.hpp"

namespace twofold {

void Lineage::add(KeyframeId culled, const GraphSnapshot& graph) {
  const Heir& heir = graph.heir(culled);
  TWOFOLD_CHECK(graph.keyframe(culled).culled() && heir.id != kNoKeyframe, "culled a moment ago");
  entries_.push_back({culled, heir.id, heir.T_this_heir});
}

void Lineage::hang_on_survivors(std::vector<FrameRecord>& frames) const {
  // An heir that was culled too was culled later: from the newest entry back, survivors of heirs are known.
  std::vector<GraphSnapshot::Survivor> survivors(entries_.size());
  IdMap position;
  for (std::size_t n = entries_.size(); n-- > 0;) {
    const Entry& entry = entries_[n];
    survivors[n] = {entry.heir, entry.T_id_heir.unpacked()};
    if (const int at = position.find(entry.heir); at >= 0) {
      const auto& [id, T_heir_survivor] = survivors[static_cast<std::size_t>(at)];
      survivors[n] = {id, survivors[n].T_this_survivor * T_heir_survivor};
    }
    position.set(entry.id, static_cast<int>(n));
  }
  for (FrameRecord& frame : frames) {
    const int at = position.find(frame.reference);
    if (at < 0) continue;
    const auto& [id, T_ref_survivor] = survivors[static_cast<std::size_t>(at)];
    frame.reference = id;
    frame.T_c_ref = PackedPose(frame.T_c_ref.unpacked() * T_ref_survivor);
  }
}

}  // namespace twofold
