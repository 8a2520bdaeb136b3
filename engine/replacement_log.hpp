#pragma once

#include "engine/chunked_vector.hpp"
#include "engine/result.hpp"
#include "graph/snapshot.hpp"

namespace twofold {

/// What became of the keyframes culled during a run. The map forgets after some time; frames that were
/// tracked against such keyframes do not, so that this grows with the trajectory: 64 bytes a culled keyframe.
///
/// Written by the mapper's thread, round by round; read when that was joined.
class ReplacementLog {
 public:
  /// Takes down the replacement of a keyframe that was culled in the newest round; to be called in the order
  /// of culling.
  void add(KeyframeId culled, const GraphSnapshot& graph);

  /// Hangs each frame whose reference was culled on the keyframe that stands for it in the final map. Poses
  /// in the map stay what they were.
  void hang_on_live_keyframes(ChunkedVector<FrameRecord>& frames) const;

 private:
  struct Entry {
    KeyframeId id = kNoKeyframe;
    KeyframeId replacement = kNoKeyframe;  ///< in the map when `id` was culled
    PackedPose T_id_replacement;
  };
  ChunkedVector<Entry> entries_;
};

}  // namespace twofold
