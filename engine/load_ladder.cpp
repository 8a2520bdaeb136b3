#include "engine/load_ladder.hpp"

#include "geometry/check.hpp"

namespace twofold {

std::string LadderOptions::invalid_reason() const {
  if (!(early > 0 && early <= late)) return "ladder: early must be in (0, late], is " + std::to_string(early);
  if (!(drop_after >= late)) return "ladder: drop_after must be >= late, is " + std::to_string(drop_after);
  if (patience < 1) return "ladder: patience must be >= 1, is " + std::to_string(patience);
  return {};
}

LoadLadder::LoadLadder(const LadderOptions& options) : options_(options) {
  TWOFOLD_CHECK(options.invalid_reason().empty(), "ladder options");
}

bool LoadLadder::must_drop(const Arrival& arrival) const {
  if (!arrival.overtaken) return false;
  return rung_ == LadderRung::kDropFrames ||
         static_cast<double>(arrival.late_ns) > options_.drop_after * static_cast<double>(arrival.period_ns);
}

void LoadLadder::tracked(std::int64_t latency_ns, std::int64_t period_ns) {
  if (period_ns <= 0) return;  // no pace to keep
  const double lateness = static_cast<double>(latency_ns) / static_cast<double>(period_ns);
  if (lateness > options_.late) return down();
  early_frames_ = lateness < options_.early ? early_frames_ + 1 : 0;
  if (early_frames_ < options_.patience || rung_ == LadderRung::kEverything) return;
  rung_ = static_cast<LadderRung>(static_cast<int>(rung_) - 1);
  early_frames_ = 0;
}

void LoadLadder::down() {
  early_frames_ = 0;
  if (rung_ != LadderRung::kDropFrames) rung_ = static_cast<LadderRung>(static_cast<int>(rung_) + 1);
}

}  // namespace twofold
