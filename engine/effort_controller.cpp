#include "engine/effort_controller.hpp"

#include "base/check.hpp"
#include "base/option_check.hpp"

namespace twofold {

std::string EffortOptions::invalid_reason() const {
  return OptionCheck()
      .that(early > 0 && early <= late, "early", "in (0, late]", early)
      .that(drop_after >= late, "drop_after", ">= late", drop_after)
      .at_least("patience", patience, 1)
      .reason();
}

EffortController::EffortController(const EffortOptions& options, LatePolicy late)
    : options_(options), late_(late) {
  TWOFOLD_CHECK(options.invalid_reason().empty(), "effort options");
}

bool EffortController::must_drop(const Arrival& arrival) const {
  if (!arrival.overtaken || late_ == LatePolicy::kQueue) return false;
  if (late_ == LatePolicy::kNewest) return true;
  return effort_ == EffortLevel::kDropFrames ||
         static_cast<double>(arrival.late_ns) > options_.drop_after * static_cast<double>(arrival.period_ns);
}

void EffortController::tracked(std::int64_t latency_ns, std::int64_t period_ns) {
  if (period_ns <= 0) return;  // no pace to keep
  const double lateness = static_cast<double>(latency_ns) / static_cast<double>(period_ns);
  if (lateness > options_.late) return down();
  early_frames_ = lateness < options_.early ? early_frames_ + 1 : 0;
  if (early_frames_ < options_.patience || effort_ == EffortLevel::kEverything) return;
  effort_ = static_cast<EffortLevel>(static_cast<int>(effort_) - 1);
  early_frames_ = 0;
}

void EffortController::down() {
  early_frames_ = 0;
  if (effort_ != EffortLevel::kDropFrames) effort_ = static_cast<EffortLevel>(static_cast<int>(effort_) + 1);
}

}  // namespace twofold
