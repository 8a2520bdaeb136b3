#include "experiments/double_window/experiments.hpp"
namespace twofold::bench {
void double_loop_experiment(const DoubleWindowExperimentOptions&, Report&) {}
}  // namespace twofold::bench
