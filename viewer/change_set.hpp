#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <utility>
#include <vector>

namespace twofold {

using Revision = std::uint32_t;

/// Records in the order of their keys, each with the revision it changed in last, so that what changed since
/// any revision can be told to somebody who knows that one. What is gone is remembered for a while: `knows`
/// says whether that is long enough.
///
/// Record: key(), and differs(shown, now), which says whether the change is worth telling. One thread.
template <class Record>
class ChangeSet {
 public:
  using Key = decltype(std::declval<const Record&>().key());
  static constexpr std::size_t kGoneKept = 1U << 16;

  /// Makes the contents `now`, ascending by key. False: nothing to tell.
  bool replace(const std::vector<Record>& now, Revision revision) {
    std::vector<Entry> next;
    next.reserve(now.size());
    bool changed = false;
    auto old = entries_.begin();
    const auto drop_below = [&](auto is_below) {
      for (; old != entries_.end() && is_below(old->record.key()); ++old) {
        forget(old->record.key(), revision);
        changed = true;
      }
    };
    for (const Record& record : now) {
      drop_below([&](Key key) { return key < record.key(); });
      const bool known = old != entries_.end() && old->record.key() == record.key();
      const bool tell = !known || differs(old->record, record);
      next.push_back(tell ? Entry{record, revision} : *old);
      changed |= tell;
      if (known) ++old;
    }
    drop_below([](Key) { return true; });
    entries_ = std::move(next);
    return changed;
  }

  /// `record` is new; its key is greater than all others.
  void append(const Record& record, Revision revision) { entries_.push_back({record, revision}); }

  /// change(record) says whether it changed the record.
  template <class Change>
  void change_all(Revision revision, const Change& change) {
    for (Entry& entry : entries_) {
      if (change(entry.record)) entry.revision = revision;
    }
  }

  /// Forgets records for which is_gone(position) holds.
  template <class IsGone>
  void drop(Revision revision, const IsGone& is_gone) {
    std::vector<Entry> next;
    for (std::size_t i = 0; i < entries_.size(); ++i) {
      if (is_gone(i)) {
        forget(entries_[i].record.key(), revision);
      } else {
        next.push_back(entries_[i]);
      }
    }
    entries_ = std::move(next);
  }

  /// Whether everything that is gone since then is remembered; of revision 0 on everything is new.
  [[nodiscard]] bool knows(Revision since) const { return since == 0 || since >= forgotten_; }
  [[nodiscard]] std::vector<Record> changed_since(Revision since) const {
    std::vector<Record> changed;
    for (const Entry& entry : entries_) {
      if (entry.revision > since) changed.push_back(entry.record);
    }
    return changed;
  }
  /// Empty for revision 0: who knows nothing has nothing to forget.
  [[nodiscard]] std::vector<Key> gone_since(Revision since) const {
    std::vector<Key> gone;
    for (const auto& [key, revision] : gone_) {
      if (since > 0 && revision > since) gone.push_back(key);
    }
    return gone;
  }

  [[nodiscard]] std::size_t size() const { return entries_.size(); }
  [[nodiscard]] const Record* find(Key key) const {
    const auto at = std::lower_bound(entries_.begin(), entries_.end(), key,
                                     [](const Entry& entry, Key k) { return entry.record.key() < k; });
    return at != entries_.end() && at->record.key() == key ? &at->record : nullptr;
  }

 private:
  struct Entry {
    Record record;
    Revision revision = 0;
  };

  void forget(Key key, Revision revision) {
    gone_.emplace_back(key, revision);
    if (gone_.size() <= kGoneKept) return;
    forgotten_ = gone_.front().second;
    gone_.pop_front();
  }

  std::vector<Entry> entries_;
  std::deque<std::pair<Key, Revision>> gone_;  // in the order of revisions
  Revision forgotten_ = 0;                     // somebody who knows less than this must start afresh
};

}  // namespace twofold
