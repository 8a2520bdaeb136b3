#include <algorithm>

#include <fmt/core.h>

#include "fixtures/starts.hpp"

// One camera's start on rendered beginnings that show depth, and on others that do not: a line each.

namespace twofold {
namespace {

using testing::StartCase;
using testing::StartOutcome;

constexpr double kWithin = 2;     // [s] of moving
constexpr double kWatched = 4;    // [s]
constexpr double kWrongWay = 20;  // [degrees] between true and estimated translation

StartOutcome line(const StartCase& start) {
  const StartOutcome outcome = testing::watch(start, kWatched);
  if (outcome.seconds) {
    fmt::print("{:<26} {:5.2f} s {:6.3f} m {:5.1f} {:5.2f}\n", start.name, *outcome.seconds, outcome.path,
               outcome.direction_deg, outcome.turn_deg);
  } else {
    fmt::print("{:<26} no start: {}\n", start.name, outcome.waits_for);
  }
  return outcome;
}

int run() {
  fmt::print("{:<26} {:>7} {:>8} {:>5} {:>5}\n", "start", "after", "path", "way", "turn");
  int in_time = 0, right = 0, accepted = 0;
  const auto starts = testing::right_starts();
  for (const StartCase& start : starts) {
    const StartOutcome outcome = line(start);
    in_time += outcome.seconds.value_or(kWatched) <= kWithin;
    right += outcome.seconds && outcome.direction_deg < kWrongWay;
  }
  fmt::print("\n");
  const auto others = testing::wrong_starts();
  for (const StartCase& start : others) accepted += line(start).seconds.has_value();
  fmt::print("\n{} of {} within {} s of moving, {} in the right direction; {} of {} wrong ones accepted\n",
             in_time, starts.size(), kWithin, right, accepted, others.size());
  return 0;
}

}  // namespace
}  // namespace twofold

int main() {
  return twofold::run();
}
