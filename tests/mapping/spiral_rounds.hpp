#pragma once

#include <span>

#include "fixtures/simulation.hpp"
#include "mapping/mapper.hpp"

/// A mapper fed from a spiral, keyframe by keyframe.
namespace twofold::simulation {

/// Without culling and metric loop closure.
inline MapperOptions small_windows() {
  MapperOptions options;
  options.inner_window = 15;
  options.outer_window = 50;
  options.culling.keyframes = options.culling.points = false;
  options.loop.enabled = false;
  return options;
}

inline Simulation spiral(int keyframes, unsigned seed, double outliers = 0,
                         SensorKind kind = SensorKind::kStereo) {
  Options options;
  options.rig = thesis_rig(kind);
  options.seed = seed;
  options.outliers = outliers;
  options.max_observations = 120;
  const std::vector<SE3> path = spiral_path(keyframes, 0.2, 0.8, 1.2);
  return {options, scattered_points(path, 2, 25, seed), path};
}

inline MapperReport map_next(Simulation& simulation, Mapper& mapper) {
  KeyframeProposal* proposal = &simulation.propose(mapper.graph());
  return mapper.step(std::span(&proposal, 1));
}

/// RMSE of the relative positions of the inner window's keyframes [m].
inline double inner_error(const Mapper& mapper, const Simulation& simulation) {
  const DoubleWindow& window = mapper.window();
  return relative_error(mapper.graph(), simulation,
                        [&](KeyframeId i, KeyframeId j) { return window.is_inner(i) && window.is_inner(j); })
      .rmse;
}

}  // namespace twofold::simulation
