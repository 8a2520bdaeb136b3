#pragma once

#include <concepts>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <utility>
#include <vector>

#include "base/atomics.hpp"
#include "base/check.hpp"

namespace twofold {

/// An immutable value with a version number that grows from one published value to the next, starting above
/// 0.
template <class T>
concept Versioned = requires(const T& value) {
  { value.version() } -> std::convertible_to<std::uint64_t>;
};

template <Versioned T, class Atomics>
class SnapshotPublisher;

/// Newest version of T for ONE reader thread; the other side is the publisher's.
///
/// Progress: wait-free on both sides, one exchange each. The reader frees nothing and touches no reference
/// count.
///
/// put (writer): exchanges the new version in; what comes back was never seen by the reader.
/// latest (reader): exchanges it out, if there is one, and only then announces the version it now holds.
/// The announcement of v says: "I have let go of everything older than v".
///
/// Ordering.
/// (A) slot_ exchange, release in put -> acquire in latest: publishes the version's contents to the reader.
/// (B) held_ release in latest -> acquire in held(): the reader's last access to older versions, which
///     precedes its call of latest in program order, happens before the writer destroys them.
/// (C) What put gets back was written by the writer itself and never left the slot: no order is needed.
///     The reader's exchange writes null, which carries nothing: its release half would publish nothing.
template <Versioned T, class Atomics = StdAtomics>
class SnapshotMailbox {
 public:
  /// Reader. The newest version; valid until this reader's next call of latest. A first version is there from
  /// construction of the publisher on.
  [[nodiscard]] const T& latest() {
    const T* next = slot_.exchange(nullptr, std::memory_order_acquire);  // (A)
    if (next == nullptr) return *current_;
    current_ = next;
    held_.store(next->version(), std::memory_order_release);  // (B)
    return *current_;
  }

 private:
  friend class SnapshotPublisher<T, Atomics>;

  /// Writer. Null when the reader took the version put before, else that version.
  const T* put(const T* next) { return slot_.exchange(next, std::memory_order_release); }  // (A), (C)
  /// Writer. The reader accesses no version older than this any more.
  std::uint64_t held() const { return held_.load(std::memory_order_acquire); }  // (B)

  alignas(kCacheLine) typename Atomics::template Atomic<const T*> slot_{nullptr};
  alignas(kCacheLine) typename Atomics::template Atomic<std::uint64_t> held_{0};
  const T* current_ = nullptr;  // reader's
};

/// Owns the published versions of T and hands the newest to N readers.
///
/// Roles: one writer thread constructs versions, calls publish and collect, and alone destroys versions;
/// reader i calls latest on mailbox(i). Readers must have stopped before the publisher is destroyed.
/// Progress: publish is wait-free: N exchanges, and O(N^2) work on its own books; the books and the room for
/// the versions are allocated at construction. It destroys nothing, for that takes as long as what a version
/// had to itself is large, and readers wait for the newest meanwhile: collect does, once it is handed out.
///
/// A version may be destroyed once each reader has either handed it back through put or announced a newer
/// one. That needs no reference count: the writer keeps, for each version, the set of readers that may still
/// come to it.
///
/// Bound: at most 2 N + 1 versions live after collect, 2 N + 2 before it. Let the writer read held = h from a
/// reader after a put. Versions that reader took are announced one after the other before the next is taken,
/// so of those it took only h itself and one taken but not yet announced are not older than h. Besides these
/// two it can only come to the version put last, which is the same for all readers: 2 N + 1. A new one is
/// made before the round of puts: 2 N + 2, for which room is fixed. A reader that stops calling latest pins
/// no more than this.
template <Versioned T, class Atomics = StdAtomics>
class SnapshotPublisher {
 public:
  static constexpr std::size_t kMaxReaders = 8;

  /// `initial` is put into every mailbox before any reader can run.
  SnapshotPublisher(std::size_t readers, T initial)
      : readers_(readers), boxes_(std::make_unique<Mailbox[]>(readers)), versions_(2 * readers + 2) {
    TWOFOLD_CHECK(readers >= 1 && readers <= kMaxReaders, "number of snapshot readers");
    publish(std::move(initial));
  }
  SnapshotPublisher(const SnapshotPublisher&) = delete;
  SnapshotPublisher& operator=(const SnapshotPublisher&) = delete;

  /// Writer. Makes `next` the newest version. Its version must be greater than the last published one. If
  /// collect was not called since the last publish, it is first.
  void publish(T next) {
    TWOFOLD_CHECK(next.version() > newest_, "snapshot versions must grow");
    if (!collected_) collect();
    collected_ = false;
    newest_ = next.version();
    Entry& entry = free_entry();
    entry.value.emplace(std::move(next));
    entry.readers = (1u << readers_) - 1;
    for (std::size_t r = 0; r < readers_; ++r) {
      if (const T* returned = boxes_[r].put(&*entry.value)) leave(entry_of(returned), r);
    }
  }

  /// Writer. Destroys every version no reader can come to any more. Worth a call after publish, and when the
  /// writer idles, so that memory does not wait for the next publication. Returns how many versions live on.
  std::size_t collect() {
    collected_ = true;
    for (std::size_t r = 0; r < readers_; ++r) {
      const std::uint64_t held = boxes_[r].held();
      for (Entry& entry : versions_) {
        if (entry.value && entry.value->version() < held) leave(entry, r);
      }
    }
    std::size_t live = 0;
    for (Entry& entry : versions_) {
      if (entry.readers == 0) entry.value.reset();
      live += entry.value.has_value();
    }
    return live;
  }

  [[nodiscard]] SnapshotMailbox<T, Atomics>& mailbox(std::size_t reader) {
    TWOFOLD_CHECK(reader < readers_, "snapshot reader");
    return boxes_[reader];
  }
  /// Writer. Version published last.
  [[nodiscard]] std::uint64_t newest() const { return newest_; }

 private:
  using Mailbox = SnapshotMailbox<T, Atomics>;
  struct Entry {
    std::optional<T> value;
    unsigned readers = 0;  // bit r: reader r may still come to it
  };

  void leave(Entry& entry, std::size_t reader) { entry.readers &= ~(1u << reader); }
  Entry& free_entry() {
    for (Entry& entry : versions_) {
      if (!entry.value) return entry;
    }
    check_failed("free_entry", "more snapshots outstanding than the protocol allows", __FILE__, __LINE__);
  }
  Entry& entry_of(const T* value) {
    for (Entry& entry : versions_) {
      if (entry.value && &*entry.value == value) return entry;
    }
    check_failed("entry_of", "mailbox returned an unknown snapshot", __FILE__, __LINE__);
  }

  const std::size_t readers_;
  const std::unique_ptr<Mailbox[]> boxes_;
  std::vector<Entry> versions_;
  std::uint64_t newest_ = 0;
  bool collected_ = true;  // since the last publish
};

}  // namespace twofold
