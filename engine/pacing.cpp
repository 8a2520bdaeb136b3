#include "engine/pacing.hpp"

#include <algorithm>
#include <chrono>
#include <cmath>

#include "geometry/check.hpp"
#include "geometry/option_check.hpp"

namespace twofold {

std::string PacingOptions::invalid_reason() const {
  return OptionCheck().that(std::isfinite(speed) && speed >= 0, "speed", "finite and >= 0", speed).reason();
}

void PacingClock::sleep_until(std::int64_t t_ns, const std::stop_token& stop) {
  const std::chrono::steady_clock::time_point deadline{std::chrono::nanoseconds(t_ns)};
  (void)parking_.wait_until(stop, deadline, [] { return false; });
}

Pacer::Pacer(const PacingOptions& options, PacingClock* clock)
    : options_(options), clock_(clock == nullptr ? &steady_ : clock) {
  TWOFOLD_CHECK(options.invalid_reason().empty(), "pacing options");
}

std::int64_t Pacer::due_ns(std::int64_t t_ns) const {
  return start_ns_ + std::llround(static_cast<double>(t_ns - first_t_ns_) / options_.speed);
}

Arrival Pacer::wait_for(std::int64_t t_ns, std::optional<std::int64_t> next_t_ns,
                        const std::stop_token& stop) {
  std::int64_t now_ns = clock_->now_ns();
  if (options_.speed == 0) return {now_ns, 0, 0, false};
  const bool first = !started_;
  if (first) {
    started_ = true;
    first_t_ns_ = t_ns;
    start_ns_ = now_ns;
  }
  Arrival arrival{due_ns(t_ns), 0, 0, false};
  if (next_t_ns) period_ns_ = due_ns(*next_t_ns) - arrival.scheduled_ns;
  arrival.period_ns = period_ns_;
  if (now_ns < arrival.scheduled_ns) {
    clock_->sleep_until(arrival.scheduled_ns, stop);
    now_ns = clock_->now_ns();
  }
  arrival.late_ns = std::max<std::int64_t>(now_ns - arrival.scheduled_ns, 0);
  arrival.overtaken =
      options_.late == LatePolicy::kDrop && !first && next_t_ns && now_ns >= due_ns(*next_t_ns);
  return arrival;
}

}  // namespace twofold
