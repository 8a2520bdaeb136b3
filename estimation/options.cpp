#include "base/option_check.hpp"
#include "estimation/motion_only.hpp"
#include "estimation/window_problem.hpp"

namespace twofold {

std::string MotionOnlyOptions::invalid_reason() const {
  return OptionCheck()
      .at_least("max_iterations", max_iterations, 1)
      .above("inlier_chi2_mono", inlier_chi2_mono, 0)
      .above("inlier_chi2_stereo", inlier_chi2_stereo, 0)
      .at_least("rounds", rounds, 1)
      .at_least("stop_step", stop_step, 0)
      .reason();
}

std::string WindowSolverOptions::invalid_reason() const {
  return OptionCheck()
      .at_least("max_iterations", max_iterations, 1)
      .at_least("initial_damping", initial_damping, 0)
      .at_least("relative_decrease", relative_decrease, 0)
      .reason();
}

}  // namespace twofold
