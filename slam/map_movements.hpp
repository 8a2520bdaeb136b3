#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <vector>

#include "engine/result.hpp"
#include "engine/spsc_ring.hpp"
#include "graph/snapshot.hpp"
#include "mapping/double_window.hpp"

namespace twofold {

/// What a version of the map did to the keyframes of the one before.
struct MapMovement {
  std::uint64_t version = 0;
  std::uint32_t keyframes = 0;  ///< that moved by a centimetre or 0.2 degrees, or joined another part
  std::uint32_t joined = 0;     ///< of these, joined another part
  double farthest = 0;          ///< that a keyframe moved [m], of those that kept their part
  double most_turned = 0;       ///< likewise [rad]
  KeyframeId loop_from =
      kNoKeyframe;  ///< the newest loop that the version, or one before, was the first to have
  KeyframeId loop_to = kNoKeyframe;
};

/// The keyframes that a loop joins.
struct LoopEnds {
  KeyframeId from = kNoKeyframe, to = kNoKeyframe;
};

/// Compares each version of the map with the one before, for the events that the tracker's thread tells.
///
/// Roles: the loop closer's thread calls found, the mapper's made, the tracker's take. None waits, and
/// take is bounded. A version is compared before it is published, so that what it did is known to whoever
/// sees it; over its windows, or, after a change of the whole map (GraphSnapshot::last_change), which has
/// changed all keyframes, over all of them: time in proportion to what the mapper did.
class MapMovements {
 public:
  void found(const ClosedLoop& loop);
  void made(const GraphSnapshot& graph, const DoubleWindow& window);
  /// What the versions up to this one did that were not taken before: of several, the largest of each number
  /// and the newest loop.
  [[nodiscard]] MapMovement take(std::uint64_t version);

 private:
  static constexpr std::size_t kLoops = 64;       // under way between loop closer and mapper
  static constexpr std::size_t kMovements = 256;  // versions that the tracker has not seen

  void compare(const GraphSnapshot& graph, KeyframeId id, MapMovement& movement) const;
  /// Which of the loops that were found the graph has by now.
  void find_loops(const GraphSnapshot& graph, MapMovement& movement);

  SpscRing<LoopEnds> loops_{kLoops};
  SpscRing<MapMovement> movements_{kMovements};
  // Mapper's:
  GraphSnapshot before_;
  std::vector<LoopEnds> awaited_;  // that the graph does not have yet
  LoopEnds newest_loop_;
  std::optional<MapMovement> unsent_;  // the ring was full
  // Tracker's: taken out, but of a later version.
  std::optional<MapMovement> early_;
};

}  // namespace twofold
