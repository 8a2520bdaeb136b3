// SharedArray under the model checker: two threads read through a handle each and drop it. One of them writes
// when it finds that its handle is the only one left, and whoever drops the last one ends the values.
#include "relacy_atomics.hpp"

namespace twofold {
namespace {

struct Value {
  rl::var<int> number{0};
  ~Value() { number($) = -1; }
};

struct SharedArrayModel : rl::test_suite<SharedArrayModel, 2> {
  using Handle = BasicSharedArray<ModelAtomics>;
  Handle handles[2];

  void before() {
    handles[0] = Handle::make<Value>(1);
    handles[0].data<Value>()->number($) = 7;
    handles[1] = handles[0];
  }
  void thread(unsigned index) {
    Handle handle = std::move(handles[index]);
    rl::var<int>& number = handle.data<Value>()->number;
    RL_ASSERT(static_cast<int>(number($)) == 7);
    if (index == 0 && !handle.shared()) number($) = 8;
  }
};

}  // namespace
}  // namespace twofold

int main(int argc, char** argv) {
  if (!twofold::parse_fault(argc, argv)) return 2;
  return twofold::check_model<twofold::SharedArrayModel>(200'000);
}
