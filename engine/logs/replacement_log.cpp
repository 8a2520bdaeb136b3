#include "engine/logs/replacement_log.hpp"

#include <algorithm>
#include <limits>
#include <vector>

#include "base/check.hpp"
#include "graph/id_map.hpp"

namespace twofold {
namespace {

constexpr std::size_t kAll = std::numeric_limits<std::size_t>::max();

}  // namespace

void ReplacementLog::keep_in(std::shared_ptr<LogFile> culled, std::shared_ptr<LogFile> scaled) {
  entries_.keep_in(std::move(culled));
  scaled_.keep_in(std::move(scaled));
}

void ReplacementLog::keep_newest(std::size_t frames) {
  // A frame proposes one keyframe at most; before the first frame kept there was the map of then.
  constexpr std::size_t kLargestMap = 100'000;
  entries_.keep_newest(frames > kAll - kLargestMap ? kAll : frames + kLargestMap);
  // A keyframe makes a round of the mapper, and the loop closer's messages about it, which are three at most,
  // as many again. Some keyframes of frames that are older still are under way.
  constexpr std::size_t kVersionsOfAFrame = 4, kUnderWay = 128;
  if (frames < kAll / kVersionsOfAFrame - kUnderWay)
    versions_kept_ = kVersionsOfAFrame * (frames + kUnderWay);
}

void ReplacementLog::read_back() {
  entries_.read_back();
  scaled_.read_back();
}

void ReplacementLog::add(KeyframeId culled, const GraphSnapshot& graph) {
  const Replacement& replacement = graph.replacement(culled);
  TWOFOLD_CHECK(graph.keyframe(culled).culled() && replacement.id != kNoKeyframe, "culled a moment ago");
  entries_.push_back({culled, replacement.id, replacement.T_this_replacement});
  ++entry_count_;
}

void ReplacementLog::add_scaling(std::uint64_t version, std::vector<KeyframeScaling> scaled) {
  if (scaled.empty()) return;
  make_room(version, scaled.size());
  const std::size_t first = scaled_count_;
  for (const KeyframeScaling& keyframe : scaled) scaled_.push_back(keyframe);
  scaled_count_ += scaled.size();
  scalings_.push_back({version, entry_count_, first, scaled_count_});
}

/// For `count` keyframes that are scaled in `version`: scalings before all frames that are kept go.
void ReplacementLog::make_room(std::uint64_t version, std::size_t count) {
  if (version <= versions_kept_) return;
  while (!scalings_.empty() && scalings_.front().version < version - versions_kept_) scalings_.pop_front();
  const std::size_t kept = scalings_.empty() ? 0 : scaled_count_ - scalings_.front().first;
  scaled_.keep_newest(kept + count);
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

void ReplacementLog::hang_on_live_keyframes(RecordSequence<FrameRecord>& frames) const {
  FinalKeyframes keyframes;
  const std::size_t forgotten = entries_.forgotten(), scales_forgotten = scaled_.forgotten();
  std::size_t entry = forgotten + entries_.size(), frame = frames.size();
  const auto take_back_culled = [&](std::size_t first) {
    while (entry > std::max(first, forgotten)) {
      const Entry& culled = entries_[--entry - forgotten];
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
    const std::size_t last = std::min(scaling.last, scales_forgotten + scaled_.size());
    for (std::size_t k = scaling.first; k < last; ++k) keyframes.was_scaled(scaled_[k - scales_forgotten]);
  }
  take_back_culled(0);
  hang(0);
}

}  // namespace twofold
