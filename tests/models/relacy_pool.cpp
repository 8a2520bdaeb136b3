// FramePool under the model checker: thread 0 fills objects and sends them to two threads by turns, which
// read and drop them; an object comes back to be filled only after it was dropped.
#include "relacy_atomics.hpp"

namespace twofold {
namespace {

constexpr int kFrames = 6;  // each object is filled anew twice

struct Object {
  rl::var<int> value{0};
};
using Handle = PoolHandle<Object, ModelAtomics>;

struct PoolModel : rl::test_suite<PoolModel, 3> {
  FramePool<Object, ModelAtomics> pool{2};
  using Ring = SpscRing<Handle, ModelAtomics>;
  // On the heap: the model checker's own allocation of this object does not heed alignas.
  std::unique_ptr<Ring> even = std::make_unique<Ring>(4);
  std::unique_ptr<Ring> odd = std::make_unique<Ring>(4);

  void thread(unsigned index) {
    if (index == 0) {
      send();
    } else {
      receive(index == 1 ? *even : *odd, index == 1 ? 0 : 1);
    }
  }
  void send() {
    for (int i = 0; i < kFrames;) {
      Handle handle = pool.try_acquire();
      if (!handle) {
        rl::yield(1, $);
        continue;
      }
      handle->value($) = i;
      // Room for all frames in flight, two, is in each ring.
      RL_ASSERT((i % 2 == 0 ? *even : *odd).try_push(std::move(handle)));
      ++i;
    }
  }
  void receive(Ring& ring, int first) {
    for (int i = first; i < kFrames;) {
      Handle handle;
      if (!ring.try_pop(handle)) {
        rl::yield(1, $);
        continue;
      }
      RL_ASSERT(static_cast<int>(handle->value($)) == i);
      i += 2;
    }
  }
};

}  // namespace
}  // namespace twofold

int main(int argc, char** argv) {
  if (!twofold::parse_fault(argc, argv)) return 2;
  return twofold::check_model<twofold::PoolModel>(200'000);
}
