#pragma once

#include <string>

#include "experiments/report.hpp"

namespace twofold::bench {

struct SlidingWindowExperimentOptions {
  int trials = 40;
  int nees_trials = 200;
  int starry_first = 122;  ///< first step used: see starry_night_experiment
  int starry_steps = 1900;
  std::string data;  ///< folder of tracks_starrynight_stereo_imu; empty: left out
};

void convergence_experiment(const SlidingWindowExperimentOptions& options,
                            Report& report);  // fig. 12, 13; 4.2.4
void sparse_marginalisation_experiment(const SlidingWindowExperimentOptions& options,
                                       Report& report);                                        // fig. 17
void patch_warping_experiment(const SlidingWindowExperimentOptions& options, Report& report);  // 4.1.2
void sideways_experiment(const SlidingWindowExperimentOptions& options, Report& report);       // fig. 15
void track_length_experiment(const SlidingWindowExperimentOptions& options, Report& report);   // fig. 16
void run_time_experiment(const SlidingWindowExperimentOptions& options, Report& report);       // fig. 14
void expansion_experiment(const SlidingWindowExperimentOptions& options, Report& report);      // fig. 2(b)
void consistency_experiment(const SlidingWindowExperimentOptions& options, Report& report);    // NEES
void starry_night_experiment(const SlidingWindowExperimentOptions& options, Report& report);   // real data

}  // namespace twofold::bench
