#pragma once

#include <cstddef>
#include <cstdint>
#include <deque>
#include <iosfwd>
#include <string>
#include <string_view>
#include <vector>

namespace twofold {

/// Number of a registered span or counter name.
using TraceName = std::uint16_t;

/// What one thread did when: spans and counter values in a ring of fixed capacity. Overflow: the oldest event
/// is overwritten and counted, because what led up to the end of a run is what one wants to see.
///
/// Roles: one thread records; Trace::write reads after that thread was joined (the join orders it; no
/// atomics). Recording is a store of 24 bytes: wait-free, no allocation.
class TraceTrack {
 public:
  TraceTrack(std::string thread_name, std::size_t capacity);

  void span(TraceName name, std::int64_t begin_ns, std::int64_t duration_ns) {
    add({begin_ns, duration_ns, name, Kind::kSpan});
  }
  /// Value of a counter from t_ns on, such as a queue's depth or the version of the snapshot in use.
  void counter(TraceName name, std::int64_t t_ns, std::int64_t value) {
    add({t_ns, value, name, Kind::kCounter});
  }

  [[nodiscard]] std::uint64_t overwritten() const {
    return added_ < ring_.size() ? 0 : added_ - ring_.size();
  }
  [[nodiscard]] std::size_t size() const { return added_ < ring_.size() ? added_ : ring_.size(); }

 private:
  friend class Trace;
  enum class Kind : std::uint8_t { kSpan, kCounter };
  struct Event {
    std::int64_t t_ns;
    std::int64_t amount;  // duration [ns] or value
    TraceName name;
    Kind kind;
  };
  void add(const Event& event) {
    ring_[next_] = event;
    next_ = next_ + 1 == ring_.size() ? 0 : next_ + 1;
    ++added_;
  }

  std::string thread_name_;
  std::vector<Event> ring_;
  std::size_t next_ = 0;
  std::uint64_t added_ = 0;
};

/// Tracks of all threads and the names they use. Names and tracks are added before the threads start; the
/// file is written after they were joined.
class Trace {
 public:
  /// The same text gives the same number. At most 65,536 names.
  [[nodiscard]] TraceName name(std::string_view text);
  /// Track of one thread; the reference stays valid while the trace lives. capacity >= 1 events.
  [[nodiscard]] TraceTrack& add_track(std::string thread_name, std::size_t capacity = 1U << 18);

  /// Chrome's trace event format in JSON, which ui.perfetto.dev and chrome://tracing open: complete events
  /// and counters, one track a thread, times in microseconds from the earliest event. Overwritten events are
  /// told in otherData. False when the stream failed.
  [[nodiscard]] bool write(std::ostream& out) const;

 private:
  void write_track(std::ostream& out, const TraceTrack& track, std::size_t thread,
                   std::int64_t origin_ns) const;

  std::vector<std::string> names_;
  std::deque<TraceTrack> tracks_;
};

}  // namespace twofold
