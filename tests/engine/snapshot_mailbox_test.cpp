#include "engine/snapshot_mailbox.hpp"

#include <gtest/gtest.h>

#include <array>
#include <atomic>
#include <cstdint>
#include <memory>
#include <thread>
#include <vector>

namespace twofold {
namespace {

/// Counts how many exist and remembers who destroys them. Contents depend on the version and are wiped on
/// death.
class Probe {
 public:
  struct Counters {
    std::atomic<int> live{0};
    std::atomic<int> most{0};
    std::atomic<int> destroyed_elsewhere{0};
    std::thread::id writer = std::this_thread::get_id();
  };

  Probe(std::uint64_t version, Counters& counters) : version_(version), counters_(&counters) {
    words_.fill(version * 31);
    const int live = ++counters.live;
    if (live > counters.most) counters.most = live;
  }
  Probe(Probe&& other) noexcept
      : version_(other.version_), words_(other.words_), counters_(std::exchange(other.counters_, nullptr)) {}
  Probe& operator=(Probe&&) = delete;
  ~Probe() {
    words_.fill(0);
    if (counters_ == nullptr) return;
    --counters_->live;
    if (std::this_thread::get_id() != counters_->writer) ++counters_->destroyed_elsewhere;
  }

  std::uint64_t version() const { return version_; }
  bool intact() const {
    for (const std::uint64_t word : words_) {
      if (word != version_ * 31) return false;
    }
    return true;
  }

 private:
  std::uint64_t version_;
  std::array<std::uint64_t, 16> words_{};
  Counters* counters_;
};

TEST(SnapshotPublisher, ReaderSeesTheNewestAndKeepsItUntilItAsksAgain) {
  Probe::Counters counters;
  SnapshotPublisher<Probe> publisher(1, Probe(1, counters));
  auto& box = publisher.mailbox(0);
  const Probe& first = box.latest();
  EXPECT_EQ(first.version(), 1u);
  publisher.publish(Probe(2, counters));
  publisher.publish(Probe(5, counters));
  EXPECT_TRUE(first.intact());
  EXPECT_EQ(box.latest().version(), 5u);
  EXPECT_EQ(box.latest().version(), 5u);
}

/// Readers wait for the newest version while the writer publishes, and no longer than that.
TEST(SnapshotPublisher, PublishDestroysNothingButWhatWasNotCollectedInTime) {
  Probe::Counters counters;
  SnapshotPublisher<Probe> publisher(1, Probe(1, counters));
  publisher.publish(Probe(2, counters));  // 1 is handed back
  EXPECT_EQ(counters.live, 2);
  publisher.publish(Probe(3, counters));
  EXPECT_EQ(counters.live, 2);
  EXPECT_EQ(publisher.collect(), 1u);
  EXPECT_EQ(counters.live, 1);
}

TEST(SnapshotPublisher, CollectDestroysHandedBackVersionsAtOnceHeldOnesWhenANewerIsAnnounced) {
  Probe::Counters counters;
  SnapshotPublisher<Probe> publisher(1, Probe(1, counters));
  auto& box = publisher.mailbox(0);
  (void)box.latest();
  publisher.publish(Probe(2, counters));
  publisher.publish(Probe(3, counters));  // 2 was never seen
  EXPECT_EQ(publisher.collect(), 2u);     // 1 is held, 3 in the box
  EXPECT_EQ(counters.live, 2);
  EXPECT_EQ(box.latest().version(), 3u);
  EXPECT_EQ(counters.live, 2);  // the reader frees nothing
  EXPECT_EQ(publisher.collect(), 1u);
  EXPECT_EQ(counters.live, 1);
}

TEST(SnapshotPublisher, ASilentReaderPinsABoundedNumber) {
  Probe::Counters counters;
  SnapshotPublisher<Probe> publisher(3, Probe(1, counters));
  (void)publisher.mailbox(0).latest();
  for (std::uint64_t v = 2; v < 100; ++v) {
    publisher.publish(Probe(v, counters));
    if (v % 7 == 0) (void)publisher.mailbox(1).latest();
    EXPECT_LE(counters.live, 8);
    if (v % 2 == 1) continue;
    EXPECT_LE(publisher.collect(), 7u);
  }
  EXPECT_TRUE(publisher.mailbox(0).latest().intact());
}

TEST(SnapshotPublisher, DestroysEverythingInTheEnd) {
  Probe::Counters counters;
  {
    SnapshotPublisher<Probe> publisher(2, Probe(1, counters));
    (void)publisher.mailbox(1).latest();
    publisher.publish(Probe(2, counters));
    publisher.publish(Probe(3, counters));
  }
  EXPECT_EQ(counters.live, 0);
}

TEST(SnapshotPublisherDeathTest, VersionsMustGrow) {
  Probe::Counters counters;
  SnapshotPublisher<Probe> publisher(1, Probe(4, counters));
  EXPECT_DEATH(publisher.publish(Probe(4, counters)), "must grow");
}

TEST(SnapshotPublisherStress, NoReaderMeetsADeadVersionAndNoneIsLeft) {
  constexpr std::uint64_t kVersions = 60'000;
  constexpr int kReaders = 2;
  Probe::Counters counters;
  std::array<std::uint64_t, kReaders> taken{};
  std::atomic<int> broken{0}, started{0};
  {
    SnapshotPublisher<Probe> publisher(kReaders, Probe(1, counters));
    std::vector<std::jthread> readers;
    for (int r = 0; r < kReaders; ++r) {
      readers.emplace_back([&, r] {
        std::uint64_t last = publisher.mailbox(r).latest().version();
        taken[r] = 1;
        ++started;
        while (last < kVersions) {
          const Probe& probe = publisher.mailbox(r).latest();
          if (probe.version() < last || !probe.intact()) ++broken;
          const bool nothing_new = probe.version() == last;
          taken[r] += probe.version() > last;
          last = probe.version();
          // A reader that spins on would keep the writer off a processor that others want, too.
          if (r == 1 || nothing_new) std::this_thread::yield();
          if (!probe.intact()) ++broken;  // still, after a while
        }
      });
    }
    // On a busy machine all versions would be published before a reader has begun.
    while (started < kReaders) std::this_thread::yield();
    for (std::uint64_t v = 2; v <= kVersions; ++v) {
      publisher.publish(Probe(v, counters));
      if (v % 64 == 0) std::this_thread::yield();
    }
    readers.clear();
    EXPECT_EQ(publisher.collect(), 1u);
    EXPECT_EQ(counters.live, 1);
  }
  EXPECT_EQ(broken, 0);
  EXPECT_EQ(counters.live, 0);
  EXPECT_EQ(counters.destroyed_elsewhere, 0);
  EXPECT_LE(counters.most, 2 * kReaders + 2);
  for (const std::uint64_t count : taken) EXPECT_GT(count, 1u);
}

}  // namespace
}  // namespace twofold
