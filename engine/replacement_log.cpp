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

void ReplacementLog::add_scaling(std::uint64_t version, std::vector<KeyframeScaling> scaled) {
  if (!scaled.empty()) scalings_.push_back({version, entries_.size(), std::move(scaled)});
}

namespace {

/// What stands for keyframes in the final map, as time runs backwards.
class FinalKeyframes {
 public:
  struct Standing {
    KeyframeId live = kNoKeyframe;
    SE3 T_this_live;    ///< in the final unit
    double factor = 1;  ///< final unit over the one at this time
  };

  [[nodiscard]] Standing of(KeyframeId id) const {
    const int at = position_.find(id);
    return at < 0 ? Standing{id, SE3(), 1} : known_[static_cast<std::size_t>(at)];
  }
  /// T_c_live of a pose relative to the keyframe `id`.
  [[nodiscard]] SE3 relative_to_live(const SE3& T_c_id, const Standing& standing) const {
    return SE3(T_c_id.so3(), standing.factor * T_c_id.translation()) * standing.T_this_live;
  }
  void was_culled(KeyframeId id, KeyframeId replacement, const SE3& T_id_replacement) {
    Standing standing = of(replacement);
    standing.T_this_live = relative_to_live(T_id_replacement, standing);
    set(id, standing);
  }
  void was_scaled(const KeyframeScaling& scaling) {
    Standing standing = of(scaling.id);
    standing.factor *= scaling.factor;
    set(scaling.id, standing);
  }

 private:
  void set(KeyframeId id, const Standing& standing) {
    const int at = position_.find(id);
    if (at >= 0) {
      known_[static_cast<std::size_t>(at)] = standing;
      return;
    }
    position_.set(id, static_cast<int>(known_.size()));
    known_.push_back(standing);
  }

  std::vector<Standing> known_;
  IdMap position_;
};

}  // namespace

void ReplacementLog::hang_on_live_keyframes(ChunkedVector<FrameRecord>& frames) const {
  FinalKeyframes keyframes;
  std::size_t entry = entries_.size(), frame = frames.size();
  const auto take_back_culled = [&](std::size_t first) {
    while (entry > first) {
      const Entry& culled = entries_[--entry];
      keyframes.was_culled(culled.id, culled.replacement, culled.T_id_replacement.unpacked());
    }
  };
  const auto hang = [&](std::uint64_t first_version) {
    for (; frame > 0; --frame) {
      FrameRecord& record = frames[frame - 1];
      if (record.state == FrameState::kDropped) continue;  // it saw no version
      if (record.snapshot_version < first_version) return;
      const FinalKeyframes::Standing standing = keyframes.of(record.reference);
      if (standing.live == record.reference && standing.factor == 1) continue;
      record.T_c_ref = PackedPose(keyframes.relative_to_live(record.T_c_ref.unpacked(), standing));
      record.reference = standing.live;
    }
  };
  for (std::size_t n = scalings_.size(); n-- > 0;) {
    const Scaling& scaling = scalings_[n];
    take_back_culled(scaling.entries_before);
    hang(scaling.version);
    for (const KeyframeScaling& keyframe : scaling.keyframes) keyframes.was_scaled(keyframe);
  }
  take_back_culled(0);
  hang(0);
}

}  // namespace twofold
