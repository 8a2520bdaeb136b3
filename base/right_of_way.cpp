#include "base/right_of_way.hpp"

#include <thread>

#include "base/check.hpp"

namespace twofold {
namespace {

using Clock = std::chrono::steady_clock;

constexpr auto kLook = std::chrono::microseconds(100);  // between two looks at whether it is still taken

/// Whom the thread makes way for.
struct Waiting {
  const RightOfWay* right = nullptr;
  std::chrono::nanoseconds longest{};
  Clock::time_point goes_on_until{};  // it has waited long enough for now
};
thread_local Waiting waiting;

}  // namespace

MakesWay::MakesWay(const RightOfWay& right, std::chrono::nanoseconds longest) {
  TWOFOLD_CHECK(waiting.right == nullptr, "a thread makes way for one at a time");
  waiting = {&right, longest, {}};
}

MakesWay::~MakesWay() {
  waiting = {};
}

void make_way() {
  if (waiting.right == nullptr || !waiting.right->taken()) return;
  const Clock::time_point begin = Clock::now();
  if (begin < waiting.goes_on_until) return;
  while (waiting.right->taken()) {
    std::this_thread::sleep_for(kLook);
    const Clock::time_point now = Clock::now();
    if (now - begin < waiting.longest) continue;
    waiting.goes_on_until = now + waiting.longest;
    return;
  }
}

}  // namespace twofold
