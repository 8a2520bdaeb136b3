#pragma once

#include <limits>

#include "experiments/double_window/scene.hpp"
#include "experiments/report.hpp"
#include "mapping/options.hpp"

namespace twofold::bench {

struct DoubleWindowExperimentOptions {
  int trials = 4;            ///< even, for two threads; ten in the thesis
  int keyframes = 500;       ///< of the spiral
  int loop_keyframes = 300;  ///< of the double loop: two rounds
  unsigned seed = 1;         ///< of the first trial
  SceneOptions scene;
  int max_anchors = 25;        ///< that take places of W2 for their points (6.2.4)
  bool metres = false;         ///< lengths in metres throughout, not in a unit of the map's own (MapUnit)
  bool coarse_edges = false;   ///< eq. 6.2 for gDWO as well, not EdgeMeasurements (stereo)
  double length_share = 0.05;  ///< of what a measured edge says about its own length
  EdgeInformationOptions edge;
};

constexpr int kUnbounded =
    std::numeric_limits<int>::max() / 4;  // window size of BA, or of the outer window, over everything

/// What all methods share: three iterations, and nothing of what only matters with wrong measurements.
[[nodiscard]] MapperOptions simulation_mapper_options(const DoubleWindowExperimentOptions& options);

void spiral_experiment(const DoubleWindowExperimentOptions& options, SensorKind kind,
                       Report& report);                                                     // fig. 6.9, 6.10
void double_loop_experiment(const DoubleWindowExperimentOptions& options, Report& report);  // fig. 6.11, 6.12

}  // namespace twofold::bench
