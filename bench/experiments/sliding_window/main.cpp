// Experiments of the sliding window filter paper (Sibley, Matthies, Sukhatme 2010).
#include <tbb/global_control.h>

#include <CLI/CLI.hpp>
#include <cstdio>

#include "experiments/parts.hpp"
#include "experiments/sliding_window/experiments.hpp"

int main(int argc, char** argv) {
  using namespace twofold::bench;
  SlidingWindowExperimentOptions options;
  std::string out = "sliding_window_results";
  std::vector<std::string> only;
  int threads = 2;
  CLI::App app{"Sliding window filter: figures 2(b), 12-17, consistency, real data with truth"};
  app.add_option("--trials", options.trials, "Monte Carlo trials of the figures")->check(CLI::PositiveNumber);
  app.add_option("--nees-trials", options.nees_trials, "trials of the consistency test")
      ->check(CLI::PositiveNumber);
  app.add_option("--data", options.data,
                 "folder tracks_starrynight_stereo_imu; without it that part is left out")
      ->check(CLI::ExistingDirectory);
  app.add_option("--first-step", options.starry_first, "first step of the recording to use")
      ->check(CLI::NonNegativeNumber);
  app.add_option("--steps", options.starry_steps, "first steps of the recording to use")
      ->check(CLI::PositiveNumber);
  app.add_option("--out", out, "folder for CSV, JSON, plots and the table");
  app.add_option(
      "--only", only,
      "run these parts only: convergence vsdf patch_warping sideways track_length run_time expansion "
      "consistency starry_night");
  app.add_option("--threads", threads, "threads over trials")->check(CLI::PositiveNumber);
  CLI11_PARSE(app, argc, argv);
  Parts<SlidingWindowExperimentOptions> all = {
      {"convergence", convergence_experiment},     {"vsdf", sparse_marginalisation_experiment},
      {"patch_warping", patch_warping_experiment}, {"sideways", sideways_experiment},
      {"track_length", track_length_experiment},   {"run_time", run_time_experiment},
      {"expansion", expansion_experiment},         {"consistency", consistency_experiment}};
  if (!options.data.empty()) all.emplace_back("starry_night", starry_night_experiment);
  try {
    const tbb::global_control limit(tbb::global_control::max_allowed_parallelism,
                                    static_cast<std::size_t>(threads));
    Report report(out);
    run_parts(all, only, options, report);
    std::fputs(report.finish().c_str(), stdout);
  } catch (const std::exception& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return 1;
  }
  return 0;
}
