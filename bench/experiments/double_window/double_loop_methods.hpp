#pragma once

#include <vector>

#include "experiments/double_window/experiments.hpp"
#include "experiments/double_window/rounds.hpp"
#include "experiments/plot.hpp"

namespace twofold::bench {

/// The contestants of the double loop; those over SE(3) throw away the scale that the loop has measured.
enum LoopMethod : std::size_t {
  kLoopBa,
  kLoopConstant,
  kLoopGlobal,
  kLoopRigid,
  kLoopGlobalRigid,
  kLoopMethods
};
constexpr const char* kLoopNames[kLoopMethods] = {"BA", "cDWO", "gDWO", "cDWO, SE(3) loop",
                                                  "gDWO, SE(3) loop"};

/// A large loop that was closed.
struct LoopEvent {
  std::size_t keyframe = 0, to = 0;
  double scale = 1;  ///< of the map around `to`, times that around `keyframe`
};

/// A map at one moment, as the figures show it.
struct LoopShot {
  std::string when;
  std::vector<Vector3> centres;  ///< of its keyframes after similarity alignment with truth [m]
  std::vector<double> scales;    ///< log_scales within the double window
};

/// What one method did in one trial.
struct LoopTrial {
  Rounds rounds;
  std::vector<LoopEvent> loops;
  std::vector<LoopShot> shots;
};
using LoopTrials = std::vector<std::vector<LoopTrial>>;  ///< by method, then trial

/// Plots of one trial.
[[nodiscard]] cv::Mat draw_loop_paths(const LoopTrials& methods, std::size_t trial, const Scene& scene);
[[nodiscard]] cv::Mat draw_loop_scales(const LoopTrials& methods, std::size_t trial);

/// The statements about the double loop, and the figures of every trial as JSON.
void state_double_loop(const LoopTrials& methods, unsigned seed, Report& report);

}  // namespace twofold::bench
