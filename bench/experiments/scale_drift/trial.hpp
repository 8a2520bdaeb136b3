#pragma once

#include <array>
#include <vector>

#include "experiments/scale_drift/loop_closing.hpp"

namespace twofold::bench {

/// Where to close a loop: frame j with the best of frames [i_begin, i_end).
struct LoopSearch {
  int i_begin = 0, i_end = 0, j = 0;
};

/// The three trajectories compared.
enum Method : std::size_t { kExplored = 0, kSe3 = 1, kSim3 = 2 };

struct DriftTrial {
  bool ok = false;  ///< explored to the end and every loop found
  std::array<double, 3> rmse{};
  std::array<std::vector<Vector3>, 3> centres;
  std::vector<Vector3> truth;
  std::vector<LoopConstraint> loops;
};

/// Exploration of a scene, then loop closing over either group. The first pose and the length of the first
/// baseline are the true ones: both are free for a single camera.
[[nodiscard]] DriftTrial run_trial(const Scene& scene, double noise_px, unsigned seed,
                                   const std::vector<LoopSearch>& searches);

}  // namespace twofold::bench
