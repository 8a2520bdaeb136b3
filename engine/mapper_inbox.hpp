#pragma once

#include <cstddef>
#include <span>
#include <utility>
#include <vector>

#include "engine/runners.hpp"
#include "engine/spsc_ring.hpp"

namespace twofold {

/// All that the mapper is told by other threads: keyframes of the tracker, loops of the loop closer. Two
/// rings, because each has one producer; the mapper's thread takes from both.
class MapperInbox {
 public:
  /// @param proposals  of the pool that all keyframes come from, a power of two or more: none is ever refused
  /// @param a_round    keyframes, and loops, that one take gives out at most, and loops that may wait;
  ///                   a power of two
  MapperInbox(std::size_t proposals, std::size_t a_round) : proposals_(proposals), loops_(a_round) {
    taken_proposals_.reserve(a_round);
    taken_loops_.reserve(a_round);
  }

  /// Tracker.
  void send(ProposalHandle proposal) {
    TWOFOLD_CHECK(proposals_.try_push(std::move(proposal)), "the ring holds every proposal of the pool");
  }
  /// Loop closer: so many messages are taken for sure.
  [[nodiscard]] std::size_t room_for_loops() const { return loops_.capacity() - loops_.size_approx(); }
  /// Loop closer. False when full; then `message` still holds what it held.
  [[nodiscard]] bool try_send(LoopMessage&& message) { return loops_.try_push(std::move(message)); }

  /// Keyframes that wait; anyone, as SpscRing::size_approx.
  [[nodiscard]] std::size_t proposals_approx() const { return proposals_.size_approx(); }
  [[nodiscard]] std::size_t loops_approx() const { return loops_.size_approx(); }

  /// Mapper.
  [[nodiscard]] bool empty() { return !proposals_.has_value() && !loops_.has_value(); }
  /// Mapper: fills proposals() and loops(), oldest first. False when there was nothing.
  [[nodiscard]] bool take() { return take(taken_proposals_.capacity(), taken_loops_.capacity()); }
  /// The same, with so many at most.
  [[nodiscard]] bool take(std::size_t proposals, std::size_t loops) {
    taken_proposals_.clear();
    ProposalHandle proposal;
    while (taken_proposals_.size() < proposals && proposals_.try_pop(proposal))
      taken_proposals_.push_back(std::move(proposal));
    taken_loops_.clear();
    while (taken_loops_.size() < loops && loops_.has_value())
      (void)loops_.try_pop(taken_loops_.emplace_back());
    return !taken_proposals_.empty() || !taken_loops_.empty();
  }
  [[nodiscard]] std::span<ProposalHandle> proposals() { return taken_proposals_; }
  [[nodiscard]] std::span<const LoopMessage> loops() const { return taken_loops_; }

 private:
  SpscRing<ProposalHandle> proposals_;
  SpscRing<LoopMessage> loops_;
  std::vector<ProposalHandle> taken_proposals_;
  std::vector<LoopMessage> taken_loops_;
};

}  // namespace twofold
