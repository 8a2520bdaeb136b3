// A camera that was covered and carried elsewhere finds itself within a second, or says that it does not
// know the place: trials in a rendered scene, each drawn from its number alone.

#include <CLI/CLI.hpp>
#include <exception>

#include <fmt/format.h>

#include "bench/places/kidnap_trial.hpp"

namespace twofold::bench {
namespace {

constexpr double kWithin = 1.0;        // [s]
constexpr double kRightWithin = 0.05;  // [m]
constexpr double kRightWithinDeg = 0.5;

bool right(const KidnapOutcome& outcome) {
  return outcome.seconds >= 0 && outcome.seconds <= kWithin && outcome.worst_error_m < kRightWithin &&
         outcome.worst_error_deg < kRightWithinDeg;
}

int mapped(KidnapTrials& trials, int count) {
  fmt::print("carried within the mapped place\n{:>5} {:>8} {:>8} {:>9} {:>9} {:>10} {:>11} {:>10}\n", "trial",
             "covered", "carried", "found [s]", "tracked", "worst [m]", "worst [deg]", "before [m]");
  int passed = 0;
  for (int n = 0; n < count; ++n) {
    const Kidnapping kidnapping =
        draw_kidnapping(static_cast<std::uint64_t>(n), trials.round_seconds(), false);
    const KidnapOutcome outcome = trials.run(kidnapping);
    const bool ok = right(outcome);
    passed += ok ? 1 : 0;
    fmt::print("{:>5} {:>8.2f} {:>8.2f} {:>9.3f} {:>6}/{:<3} {:>9.4f} {:>11.3f} {:>10.4f}{}\n", n,
               kidnapping.cover_at, kidnapping.carried_to, outcome.seconds, outcome.frames_in_old_map,
               outcome.frames_watched, outcome.worst_error_m, outcome.worst_error_deg, outcome.error_before_m,
               ok ? "" : "  FAILED");
    std::fflush(stdout);
  }
  fmt::print("{} of {} found within {} s, worst error below {} m and {} deg\n\n", passed, count, kWithin,
             kRightWithin, kRightWithinDeg);
  return passed;
}

int unmapped(KidnapTrials& trials, int count) {
  fmt::print("carried to a place that was never mapped\n{:>5} {:>8} {:>21}\n", "trial", "covered",
             "poses in the old map");
  int passed = 0;
  for (int n = 0; n < count; ++n) {
    const Kidnapping kidnapping =
        draw_kidnapping(static_cast<std::uint64_t>(n), trials.round_seconds(), true);
    const KidnapOutcome outcome = trials.run(kidnapping);
    const bool ok = outcome.frames_in_old_map == 0;
    passed += ok ? 1 : 0;
    fmt::print("{:>5} {:>8.2f} {:>17}/{:<3}{}\n", n, kidnapping.cover_at, outcome.frames_in_old_map,
               outcome.frames_watched, ok ? "" : "  FAILED");
    std::fflush(stdout);
  }
  fmt::print("{} of {} never placed in the old map\n", passed, count);
  return passed;
}

int main_of(int argc, char** argv) {
  CLI::App app("Kidnapped camera: relocalised within a second, or rejected");
  KidnapOptions options;
  int trials = 20;
  app.add_option("--scene", options.scene)->capture_default_str();
  app.add_option("--trials", trials, "Of each kind")->capture_default_str()->check(CLI::PositiveNumber);
  app.add_option("--width", options.width, "[px]")->capture_default_str();
  app.add_option("--fps", options.fps)->capture_default_str();
  app.add_option("--noise", options.noise, "[grey levels]")->capture_default_str();
  CLI11_PARSE(app, argc, argv);
  KidnapTrials kidnaps(options);
  const int found = mapped(kidnaps, trials);
  const int rejected = unmapped(kidnaps, trials);
  return found == trials && rejected == trials ? 0 : 1;
}

}  // namespace
}  // namespace twofold::bench

int main(int argc, char** argv) {
  try {
    return twofold::bench::main_of(argc, argv);
  } catch (const std::exception& error) {
    fmt::print(stderr, "kidnap: {}\n", error.what());
    return 2;
  }
}
