#pragma once

#include <vector>

#include "experiments/report.hpp"
#include "experiments/scale_drift/scene.hpp"

namespace twofold::bench {

struct ScaleDriftOptions {
  int samples = 100;          ///< of a cell of table 5.1 (thesis: 100), >= 2
  double spread = 0.25;       ///< standard deviation of a in A = exp(a); the thesis does not name its own
  double step = 2e-6;         ///< of the numerical Jacobian's forward differences; not named either
  int trials = 10;            ///< of each noise level of the circle (thesis: 10), >= 1
  double circle_radius = 10;  ///< [m]; 72 poses and 500 points a metre of it, as in the thesis
  std::vector<double> noise_px = {0, 0.2, 0.4, 0.6, 0.8, 1.0, 1.2};  ///< levels of the circle, >= 0
  int sphere_trials = 10;                                            ///< >= 1; the thesis shows one run
  SphereOptions sphere;           ///< of the flight; a loop closure wherever it passes a place again
  double sphere_noise_px = 0.75;  ///< >= 0, that of the thesis' program
  bool compare = true;            ///< state SE(3) against Sim(3); small scenes hardly drift
  unsigned seed = 1;              ///< of the first trial
};

void jacobian_experiment(const ScaleDriftOptions& options, Report& report);  // table 5.1
void circle_experiment(const ScaleDriftOptions& options, Report& report);    // fig. 5.5
void sphere_experiment(const ScaleDriftOptions& options, Report& report);    // fig. 5.6

}  // namespace twofold::bench
