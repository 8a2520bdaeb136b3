#pragma once

#include "experiments/report.hpp"

namespace twofold::bench {

struct WhyFilterOptions {
  int trials = 60;      ///< Monte Carlo trials of a cheap cell
  int min_trials = 12;  ///< of the dearest ones: N and M large, filter
  double cell_seconds =
      4;                ///< trials of a cell are cut to about this processor time, but not below min_trials
  bool large_n = true;  ///< N = 480 for the smallest M
};

void preliminary_experiment(const WhyFilterOptions& options, Report& report);  // fig. 4.3
void motion_experiment(const WhyFilterOptions& options, Report& report);       // fig. 4.10
void cost_experiment(const WhyFilterOptions& options, Report& report);         // fig. 4.11
void monte_carlo_experiment(const WhyFilterOptions& options, Report& report);  // fig. 4.6 - 4.9, 4.12, 4.13

}  // namespace twofold::bench
