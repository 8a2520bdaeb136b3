#include "viewer/look_times.hpp"

#include <algorithm>
#include <cstdlib>

namespace twofold {
namespace {

constexpr std::int64_t kMarginNs =
    2'000'000;                         // by how much frames that take longer are told later than others
constexpr std::int64_t kMissing = 10;  // frames that did not come, after which none is expected
constexpr std::int64_t kMemory = 32;   // frames of which the interval is the average

std::int64_t divide_rounded(std::int64_t a, std::int64_t b) {
  return (a + b / 2) / b;
}

/// As long as `period_ns` or so, of which a whole number makes an interval, or which whole intervals make.
std::int64_t step_in(std::int64_t interval_ns, std::int64_t period_ns) {
  return interval_ns > period_ns ? interval_ns / divide_rounded(interval_ns, period_ns)
                                 : interval_ns * divide_rounded(period_ns, interval_ns);
}

}  // namespace

void LookTimes::add_frame(std::int64_t frame, std::int64_t t_ns) {
  const std::int64_t frames = frame - frame_;
  const bool follows = frame_ >= 0 && frames > 0 && frames <= kMissing;
  const std::int64_t found_ns = follows ? std::max<std::int64_t>(t_ns - told_ns_, 0) / frames : 0;
  const bool changed = std::abs(found_ns - interval_ns_) > interval_ns_ / 2;
  averaged_ = changed ? 1 : std::min(averaged_ + 1, kMemory);
  interval_ns_ += (found_ns - interval_ns_) / averaged_;
  frame_ = frame;
  told_ns_ = t_ns;
}

std::int64_t LookTimes::next(std::int64_t now_ns, std::int64_t period_ns) const {
  if (interval_ns_ <= 0 || now_ns - told_ns_ > kMissing * interval_ns_) return now_ns + period_ns;
  const std::int64_t step_ns = step_in(interval_ns_, period_ns);
  const std::int64_t first_ns = told_ns_ + kMarginNs;
  const std::int64_t steps = divide_rounded(std::max<std::int64_t>(now_ns + step_ns - first_ns, 0), step_ns);
  return first_ns + steps * step_ns;
}

}  // namespace twofold
