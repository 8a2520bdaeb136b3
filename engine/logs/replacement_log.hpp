#pragma once

#include <deque>
#include <limits>
#include <memory>
#include <vector>

#include "engine/logs/record_sequence.hpp"
#include "engine/result.hpp"
#include "graph/snapshot.hpp"
#include "mapping/similarity_loop.hpp"

namespace twofold {

/// What became of the keyframes that frames were tracked against: culled during a run, or scaled by a loop of
/// one camera. The map forgets after some time; frames do not, so that this grows with the trajectory: 64
/// bytes a culled keyframe, 16 for each that a loop scaled, in memory or on disk.
///
/// Written by the mapper's thread, round by round; read when that was joined.
class ReplacementLog {
 public:
  /// Before the first call of the others; files that hold nothing else.
  void keep_in(std::shared_ptr<LogFile> culled, std::shared_ptr<LogFile> scaled);
  /// Without files: enough for so many of the newest frames, in maps of up to 100,000 keyframes.
  void keep_newest(std::size_t frames);
  /// Keyframes scaled by loops that are not forgotten, each as often as it was.
  [[nodiscard]] std::size_t scales_in_memory() const { return scaled_.size(); }
  /// When the files are written: hang_on_live_keyframes may be called.
  void read_back();

  /// Takes down the replacement of a keyframe that was culled in the newest round; to be called in the order
  /// of culling.
  void add(KeyframeId culled, const GraphSnapshot& graph);
  /// Takes down which keyframes have another unit from version `version` of the map on; before those culled
  /// in that version.
  void add_scaling(std::uint64_t version, std::vector<KeyframeScaling> scaled);

  /// Hangs each frame whose reference was culled on the keyframe that stands for it in the final map, in the
  /// unit that this has. Poses in the map stay what they were. Frames are in the order of their versions.
  void hang_on_live_keyframes(RecordSequence<FrameRecord>& frames) const;

 private:
  void make_room(std::uint64_t version, std::size_t count);

  struct Entry {
    KeyframeId id = kNoKeyframe;
    KeyframeId replacement = kNoKeyframe;  ///< in the map when `id` was culled
    PackedPose T_id_replacement;
  };
  /// A loop's, between the entries of keyframes that were culled before and after it.
  struct Scaling {
    std::uint64_t version = 0;
    std::size_t entries_before = 0;
    std::size_t first = 0, last = 0;  ///< of scaled_, those forgotten included
  };
  RecordSequence<Entry> entries_;
  RecordSequence<KeyframeScaling> scaled_;
  std::size_t entry_count_ = 0, scaled_count_ = 0;
  std::deque<Scaling> scalings_;
  std::uint64_t versions_kept_ = std::numeric_limits<std::uint64_t>::max();
};

}  // namespace twofold
