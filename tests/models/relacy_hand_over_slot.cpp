// HandOverSlot under the model checker: what is taken is whole and newer than what was taken before, and of
// all that was put each is destroyed once, by who took it or by the slot.
#include "relacy_atomics.hpp"

namespace twofold {
namespace {

constexpr int kValues = 4;
int g_destroyed = 0;  // in this execution; the checker runs all threads on one

/// Contents are plain memory; destruction writes it, as giving it back to the heap may.
class Value {
 public:
  explicit Value(int number) : number_(number) {}
  ~Value() {
    number_($) = 0;
    ++g_destroyed;
  }
  int number() { return number_($); }

 private:
  rl::var<int> number_;
};

struct HandOverSlotModel : rl::test_suite<HandOverSlotModel, 2> {
  std::unique_ptr<HandOverSlot<Value, ModelAtomics>> slot;

  void before() {
    g_destroyed = 0;
    slot = std::make_unique<HandOverSlot<Value, ModelAtomics>>();
  }
  void thread(unsigned index) {
    if (index == 0) {
      for (int n = 1; n <= kValues; ++n) slot->put(std::make_unique<Value>(n));
      return;
    }
    int last = 0;
    for (int n = 0; n < kValues; ++n) {
      const auto taken = slot->take();
      if (!taken) continue;
      RL_ASSERT(taken->number() > last);
      last = taken->number();
    }
  }
  void after() {
    slot.reset();
    RL_ASSERT(g_destroyed == kValues);
  }
};

}  // namespace
}  // namespace twofold

int main(int argc, char** argv) {
  if (!twofold::parse_fault(argc, argv)) return 2;
  return twofold::check_model<twofold::HandOverSlotModel>(200'000);
}
