#pragma once

#include <string>
#include <vector>

#include "experiments/report.hpp"

namespace twofold::bench {

struct WhyFilterOptions {
  int trials = 20;          ///< Monte Carlo trials of the filter in a cheap cell
  int ba_trials = 100;      ///< of bundle adjustment, in every cell; the first ones are the filter's
  int min_trials = 6;       ///< of the filter in the dearest cells: N and M large
  double cell_seconds = 1;  ///< the filter's trials of a cell are cut to about this processor time
  std::vector<std::string> settings = {"i", "ii", "iii", "iv"};
  bool large_n = true;  ///< N = 480 for the smallest M of setting i
};

void preliminary_experiment(const WhyFilterOptions& options, Report& report);  // fig. 4.3
void motion_experiment(const WhyFilterOptions& options, Report& report);       // fig. 4.10
void cost_experiment(const WhyFilterOptions& options, Report& report);         // fig. 4.11
void monte_carlo_experiment(const WhyFilterOptions& options, Report& report);  // fig. 4.6 - 4.9, 4.12, 4.13

}  // namespace twofold::bench
