// SpscRing under the model checker: every message arrives once, in order, and its contents, which are plain
// memory, are never touched by two threads at a time.
#include "relacy_atomics.hpp"

namespace twofold {
namespace {

constexpr int kMessages = 5;

/// Plain memory whose accesses the model checker watches.
class Message {
 public:
  Message() : value_(0) {}
  explicit Message(int value) : value_(value) {}
  Message(Message&& other) noexcept : value_(other.value()) {}
  Message& operator=(Message&& other) noexcept {
    value_($) = other.value();
    other.value_($) = -1;
    return *this;
  }
  int value() const { return value_($); }

 private:
  rl::var<int> value_;
};

struct RingModel : rl::test_suite<RingModel, 2> {
  // On the heap: the model checker's own allocation of this object does not heed alignas.
  std::unique_ptr<SpscRing<Message, ModelAtomics>> ring =
      std::make_unique<SpscRing<Message, ModelAtomics>>(2);

  void thread(unsigned index) {
    if (index == 0) {
      for (int i = 0; i < kMessages;) {
        Message message(i);
        const bool pushed = ring->try_push(std::move(message));
        RL_ASSERT(message.value() == (pushed ? -1 : i));  // a refused message stays with the caller
        if (pushed)
          ++i;
        else
          rl::yield(1, $);
      }
    } else {
      Message message;
      for (int i = 0; i < kMessages;) {
        if (!ring->try_pop(message)) {
          rl::yield(1, $);
          continue;
        }
        RL_ASSERT(message.value() == i);
        ++i;
      }
    }
  }
};

}  // namespace
}  // namespace twofold

int main(int argc, char** argv) {
  if (!twofold::parse_fault(argc, argv)) return 2;
  return twofold::check_model<twofold::RingModel>(200'000);
}
