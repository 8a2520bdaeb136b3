#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <mutex>
#include <vector>

#include "engine/result.hpp"
#include "engine/snapshot_mailbox.hpp"
#include "graph/keyframe_database.hpp"
#include "graph/persistent_vector.hpp"
#include "graph/snapshot.hpp"
#include "mapping/double_window.hpp"

namespace twofold {

/// The loops of a run, in the order they were found. Copies share what they have in common.
struct LoopList {
  PersistentVector<ClosedLoop, 5, 3> loops;

  [[nodiscard]] std::uint64_t version() const { return loops.size() + 1; }
};

/// A map as it is lent out: handles of the versions that were newest then. Never changes.
struct MapVersion {
  GraphSnapshot graph;
  std::vector<KeyframeId> inner_window;  ///< W1 of the round that made the graph
  std::vector<KeyframeId> outer_window;  ///< W2
  KeyframeDatabase places;
  LoopList loops;

  /// Counts from 1: a map before the first is empty and has graph version 0.
  [[nodiscard]] std::uint64_t version() const { return graph.version() + 1; }
};

/// Lends the newest map to any number of threads, each for as long as it likes, while mapper and loop closer
/// go on.
///
/// Roles: the mapper publishes maps, the loop closer places, both wait-free; borrowers call newest and held,
/// and take turns at a mutex that neither of the two ever takes. A loan is a copy of handles: it keeps the
/// nodes that the map has replaced since, and gives them up on the thread that lets go of it last
/// (PersistentVector says why that is sound).
class MapLender {
 public:
  /// Mapper. Versions grow.
  void publish(const GraphSnapshot& graph, const DoubleWindow& window);
  /// Loop closer. Does nothing when this version was published before.
  void publish(const KeyframeDatabase& places) {
    if (places.version() > places_.newest()) places_.publish(places);
  }
  /// Loop closer. O(log(loops)).
  void publish(const ClosedLoop& loop);

  /// Borrowers. O(1). The same object as before, while that is held and nothing newer was published.
  [[nodiscard]] std::shared_ptr<const MapVersion> newest();

  /// Anybody, now and then. Lets go of what was newest when somebody borrowed last, which the reader's ends
  /// of the publishers keep alive until they are asked again. Waits for nobody: does nothing while one
  /// borrows.
  void catch_up();

  struct Loans {
    std::size_t versions = 0;
    std::uint64_t oldest = 0;  ///< version of the map; 0: nothing is held
  };
  /// Borrowers. What is held now.
  [[nodiscard]] Loans held();

 private:
  SnapshotPublisher<MapVersion> maps_{1, {}};  // whose places are empty
  SnapshotPublisher<KeyframeDatabase> places_{1, {}};
  SnapshotPublisher<LoopList> loops_{1, {}};
  LoopList all_loops_;    // loop closer's
  std::mutex borrowers_;  // guards the readers' ends of the publishers, and loans_
  std::vector<std::weak_ptr<const MapVersion>> loans_;
};

}  // namespace twofold
