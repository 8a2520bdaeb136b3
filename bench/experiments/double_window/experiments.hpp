#pragma once

#include "experiments/double_window/scene.hpp"
#include "experiments/report.hpp"

namespace twofold::bench {

struct DoubleWindowExperimentOptions {
  int trials = 10;
  int keyframes = 500;       ///< of the spiral
  int loop_keyframes = 300;  ///< of the double loop: two rounds
  unsigned seed = 1;         ///< of the first trial
  SceneOptions scene;
};

void spiral_experiment(const DoubleWindowExperimentOptions& options, SensorKind kind,
                       Report& report);                                                     // fig. 6.9, 6.10
void double_loop_experiment(const DoubleWindowExperimentOptions& options, Report& report);  // fig. 6.11, 6.12

}  // namespace twofold::bench
