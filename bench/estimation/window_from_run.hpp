#pragma once

#include <string>

#include "estimation/window_problem.hpp"

namespace twofold {

/// Which problem to take out of which run.
struct RunOptions {
  std::string source;  ///< of frames, as `twofold run` takes it
  int inner = 25;      ///< windows of the mapper
  int outer = 175;
  int round = 0;  ///< of the mapper, from 1; 0: the last of those with the most poses
};

struct RunProblem {
  WindowProblem problem;
  int round = 0;   ///< it was taken from
  int rounds = 0;  ///< the mapper made in all
};

/// Runs the engine over the source, one thread and one order, and takes the problem one of the mapper's
/// rounds starts its joint optimisation from: the newest keyframe is where the tracker put it. Throws
/// std::runtime_error when the source cannot be opened or read, or there was no such round.
[[nodiscard]] RunProblem window_from_run(const RunOptions& options);

}  // namespace twofold
