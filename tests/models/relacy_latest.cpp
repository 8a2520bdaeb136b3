// LatestValue with two readers under the model checker: what a reader gets is whole, and never older than
// what it got before; with as many slots as readers and two more, the writer gives up only until it sees them
// leave.
#include "relacy_atomics.hpp"

namespace twofold {
namespace {

constexpr int kValues = 5;
constexpr std::size_t kReaders = 2;

/// Plain memory to the model checker.
class Value {
 public:
  Value() : number_(0) {}
  explicit Value(int number) : number_(number) {}
  Value(const Value& other) : number_(other.number()) {}
  Value& operator=(const Value& other) {
    number_($) = other.number();
    return *this;
  }
  [[nodiscard]] int number() const { return number_($); }

 private:
  rl::var<int> number_;
};

struct LatestModel : rl::test_suite<LatestModel, kReaders + 1> {
  LatestValue<Value, ModelAtomics, kReaders + 2> latest;

  void thread(unsigned index) {
    if (index == 0) {
      for (int v = 1; v <= kValues; ++v) {
        while (!latest.put(Value(v))) rl::yield(1, $);  // sees late that a reader has left
      }
    } else {
      read();
    }
  }
  void read() {
    int last = 0;
    for (int i = 0; i < kValues; ++i) {
      const auto value = latest.get();
      const int seen = value ? value->number() : 0;
      RL_ASSERT(seen >= last && seen <= kValues);
      last = seen;
    }
  }
  void after() { RL_ASSERT(latest.get()->number() == kValues); }
};

}  // namespace
}  // namespace twofold

int main(int argc, char** argv) {
  if (!twofold::parse_fault(argc, argv)) return 2;
  return twofold::check_model<twofold::LatestModel>(200'000);
}
