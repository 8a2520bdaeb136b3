#include "engine/pacing.hpp"

#include <algorithm>
#include <chrono>
#include <cmath>

#include "base/check.hpp"
#include "base/option_check.hpp"

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

std::int64_t Pacer::exposed_ns(std::int64_t t_ns) const {
  if (options_.live) return t_ns;
  return start_ns_ + std::llround(static_cast<double>(t_ns - first_t_ns_) / options_.speed);
}

Arrival Pacer::wait_for(std::int64_t t_ns) {
  std::int64_t now_ns = clock_->now_ns();
  if (!options_.keeps_pace()) return {now_ns, 0, 0, false};
  if (!started_) {
    started_ = true;
    first_t_ns_ = t_ns;
    start_ns_ = now_ns;
  }
  interval_.add(t_ns);
  Arrival arrival;
  arrival.exposed_ns = exposed_ns(t_ns);
  arrival.period_ns = exposed_ns(t_ns + interval_.ns()) - arrival.exposed_ns;
  if (!options_.live && now_ns < arrival.exposed_ns) {
    clock_->sleep_until(arrival.exposed_ns, waits_ended_.get_token());
    now_ns = clock_->now_ns();
    arrival.exposed_ns = std::min(arrival.exposed_ns, now_ns);
  }
  arrival.late_ns = std::max<std::int64_t>(now_ns - arrival.exposed_ns, 0);
  return arrival;
}

}  // namespace twofold
