// SnapshotPublisher with two readers under the model checker: versions a reader sees are whole and grow, none
// is destroyed, or its room used again, while a reader may read it, and in the end all but the newest are
// gone.
#include "relacy_atomics.hpp"

namespace twofold {
namespace {

constexpr std::uint64_t kVersions = 5;
constexpr std::size_t kReaders = 2;

/// Contents are plain memory; destruction writes it, as giving it back to the heap may.
class Version {
 public:
  explicit Version(std::uint64_t version) : version_(version) {}
  Version(Version&& other) noexcept : version_(other.version()) {}
  Version& operator=(Version&&) = delete;
  ~Version() { version_($) = 0; }
  std::uint64_t version() const { return version_($); }

 private:
  rl::var<std::uint64_t> version_;
};

struct MailboxModel : rl::test_suite<MailboxModel, kReaders + 1> {
  SnapshotPublisher<Version, ModelAtomics> publisher{kReaders, Version(1)};
  rl::atomic<std::size_t> finished;

  void before() { finished.store(0, rl::mo_relaxed, $); }

  void thread(unsigned index) {
    if (index == 0) {
      for (std::uint64_t v = 2; v <= kVersions; ++v) {
        publisher.publish(Version(v));
        if (v % 2 == 0) publisher.collect();  // else the next publish does
      }
      while (finished.load(rl::mo_relaxed, $) < kReaders) rl::yield(1, $);
    } else {
      read(publisher.mailbox(index - 1));
    }
  }
  void read(SnapshotMailbox<Version, ModelAtomics>& box) {
    std::uint64_t last = 0;
    while (last < kVersions) {
      const Version& version = box.latest();
      const std::uint64_t seen = version.version();
      RL_ASSERT(seen >= last && seen >= 1 && seen <= kVersions);
      if (seen == last) rl::yield(1, $);
      last = seen;
      RL_ASSERT(version.version() == seen);  // still, after others had their turn
    }
    finished.fetch_add(1, rl::mo_relaxed, $);
  }
  void after() { RL_ASSERT(publisher.collect() == 1); }
};

}  // namespace
}  // namespace twofold

int main(int argc, char** argv) {
  if (!twofold::parse_fault(argc, argv)) return 2;
  return twofold::check_model<twofold::MailboxModel>(200'000);
}
