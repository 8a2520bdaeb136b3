// Experiments of "Visual SLAM: Why Filter?" (Strasdat 2012, chapter 4).
#include <malloc.h>
#include <tbb/global_control.h>

#include <CLI/CLI.hpp>
#include <cstdio>
#include <ctime>

#include "experiments/parts.hpp"
#include "experiments/why_filter/experiments.hpp"

int main(int argc, char** argv) {
  using namespace twofold::bench;
  // Freed memory stays with the process: pages new from the kernel are no matter of either method, and
  // whether a matrix gets some hangs on its size and on what ran before.
  mallopt(M_MMAP_THRESHOLD, 32 << 20);
  mallopt(M_TRIM_THRESHOLD, 1 << 30);
  WhyFilterOptions options;
  std::string out = "why_filter_results";
  std::vector<std::string> only;
  int threads = 2;
  bool full = false;
  CLI::App app{"Why filter? BA-SLAM against filter-SLAM: figures 4.3, 4.6 - 4.13"};
  app.add_option("--trials", options.trials, "Monte Carlo trials of the filter in a cell")
      ->check(CLI::Range(2, 100000));
  app.add_option("--min-trials", options.min_trials, "least trials of dear cells")
      ->check(CLI::Range(2, 100000));
  app.add_option("--ba-trials", options.ba_trials, "trials of bundle adjustment")
      ->check(CLI::Range(2, 100000));
  app.add_option("--settings", options.settings, "of the Monte Carlo: i ii iii iv")
      ->check(CLI::IsMember({"i", "ii", "iii", "iv"}));
  app.add_option("--cell-seconds", options.cell_seconds,
                 "processor time to which the filter's trials of a cell are cut, not below --min-trials");
  app.add_flag("--full", full, "500 trials in every cell, as in the thesis");
  app.add_flag("!--no-480", options.large_n, "leave out N = 480");
  app.add_option("--out", out, "folder for CSV, JSON, plots and the table");
  app.add_option("--only", only, "run these parts only: preliminary motion cost monte_carlo");
  app.add_option("--threads", threads, "threads over trials")->check(CLI::PositiveNumber);
  CLI11_PARSE(app, argc, argv);
  if (full) options.trials = options.ba_trials = options.min_trials = 500;
  const Parts<WhyFilterOptions> all = {{"preliminary", preliminary_experiment},
                                       {"motion", motion_experiment},
                                       {"cost", cost_experiment},
                                       {"monte_carlo", monte_carlo_experiment}};
  try {
    const tbb::global_control limit(tbb::global_control::max_allowed_parallelism,
                                    static_cast<std::size_t>(threads));
    Report report(out);
    run_parts(all, only, options, report);
    const double minutes = static_cast<double>(std::clock()) / CLOCKS_PER_SEC / 60;
    report.state("run time", "the default run takes at most ten minutes on two cores: 20 of processor time",
                 text("%.1f minutes of processor time", minutes), minutes <= 20);
    std::fputs(report.finish().c_str(), stdout);
  } catch (const std::exception& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return 1;
  }
  return 0;
}
