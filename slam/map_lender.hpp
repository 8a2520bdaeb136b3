#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <mutex>
#include <vector>

#include "engine/result.hpp"
#include "graph/keyframe_database.hpp"
#include "graph/persistent_vector.hpp"
#include "graph/snapshot.hpp"
#include "mapping/double_window.hpp"
#include "slam/hand_over_slot.hpp"

namespace twofold {

/// The loops of a run, in the order they were found. Copies share what they have in common.
using LoopList = PersistentVector<ClosedLoop, 5, 3>;

/// A map as it is lent out: handles of the versions that were newest then. Does not change once it is.
struct MapVersion {
  GraphSnapshot graph;
  std::vector<KeyframeId> inner_window;  ///< W1 of the round that made the graph
  std::vector<KeyframeId> outer_window;  ///< W2
  KeyframeDatabase places;
  LoopList loops;
};

/// Lends the newest map to any number of threads, each for as long as it likes, while mapper and loop closer
/// go on.
///
/// Roles: the mapper publishes maps, the loop closer places and loops, all wait-free; borrowers call newest
/// and held, and take turns at a mutex that neither of the two ever takes.
///
/// Mapper and loop closer pay nothing for borrowers, however many and for however long. What they publish
/// they give away (HandOverSlot), the borrowers' side puts a loan together from it, once for each version,
/// and borrowers share that: what they count is the loan's uses, no node's, whose counts mapper and tracker
/// read. A loan keeps the nodes that the map has replaced since. Whoever lets go of a node last destroys it
/// (PersistentVector says why that is sound): the thread of a borrower that held a loan for longer than the
/// engine itself reads that version, else the mapper, as of any version.
class MapLender {
 public:
  /// Mapper. Versions grow. O(window).
  void publish(const GraphSnapshot& graph, const DoubleWindow& window);
  /// Loop closer. Does nothing when this version was published before.
  void publish(const KeyframeDatabase& places);
  /// Loop closer. O(log(loops)).
  void publish(const ClosedLoop& loop);

  /// Borrowers. O(1). The same object as before, while nothing newer was published.
  [[nodiscard]] std::shared_ptr<const MapVersion> newest();

  /// Anybody, now and then. Lets go of what was newest when somebody borrowed last, which stays here until
  /// somebody asks again. Waits for nobody: does nothing while one borrows.
  void catch_up();

  struct Loans {
    std::size_t versions = 0;
    std::uint64_t oldest = 0;  ///< version of the map; 0: nothing is held
  };
  /// Borrowers. What is held now.
  [[nodiscard]] Loans held();

 private:
  /// What newer versions took the place of: destroyed, which may take long, once nobody waits for the mutex.
  struct Replaced {
    std::shared_ptr<const MapVersion> loan;
    MapVersion version;
  };
  [[nodiscard]] Replaced take_newest();

  HandOverSlot<MapVersion> maps_;  // whose places and loops are empty
  HandOverSlot<KeyframeDatabase> places_;
  HandOverSlot<LoopList> loops_;
  // Loop closer's.
  std::uint64_t places_version_ = KeyframeDatabase().version();  // published last
  LoopList all_loops_;

  std::mutex borrowers_;  // guards what follows, and the taking ends of the slots
  MapVersion newest_;
  std::shared_ptr<const MapVersion> loan_;  // of newest_; null until somebody borrows
  std::vector<std::weak_ptr<const MapVersion>> loans_;
};

}  // namespace twofold
