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
  bool ok = false;                      ///< explored to the end and every loop found
  std::array<double, 3> rmse{};         ///< scaled about the first camera centre, as the text of 5.4 says [m]
  std::array<double, 3> rmse_centre{};  ///< scaled about the scene's centre [m]
  std::array<std::vector<Vector3>, 3> centres;
  std::vector<Vector3> truth;
  std::vector<LoopConstraint> loops;
};

/// Exploration of a scene, then loop closing over either group. The first two poses are the true ones.
[[nodiscard]] DriftTrial run_trial(const Scene& scene, double noise_px, unsigned seed,
                                   const std::vector<LoopSearch>& searches);

}  // namespace twofold::bench
