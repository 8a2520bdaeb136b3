#pragma once

#include <algorithm>
#include <cmath>
#include <nlohmann/json_fwd.hpp>
#include <span>
#include <vector>

#include "fixtures/simulation.hpp"
#include "mapping/mapper.hpp"

namespace twofold {

struct Samples {
  std::vector<double> values;

  void add(double value) { values.push_back(value); }
  [[nodiscard]] double quantile(double q) const {
    std::vector<double> sorted = values;
    std::sort(sorted.begin(), sorted.end());
    return sorted[static_cast<std::size_t>(q * static_cast<double>(sorted.size() - 1))];
  }
  [[nodiscard]] double median() const { return quantile(0.5); }
};

inline MapperOptions mapper_options(int inner, int outer) {
  MapperOptions options;
  options.inner_window = inner;
  options.outer_window = outer;
  return options;
}

/// Keyframes are not culled while exploring, so that maps of all sizes have the same windows.
inline MapperOptions exploring(int inner, int outer) {
  MapperOptions options = mapper_options(inner, outer);
  options.culling.keyframes = false;
  return options;
}

/// A straight flight over endless ground: no place is seen twice.
inline simulation::Simulation exploration(int keyframes) {
  std::vector<SE3> path;
  for (int k = 0; k < keyframes; ++k) {
    path.push_back(
        simulation::looking_down(0.12 * k, 0.5 * std::sin(0.05 * k), 1.2, 0.1 * std::sin(0.1 * k)));
  }
  simulation::Options options;
  options.rig = simulation::thesis_rig();
  options.max_observations = 180;
  return {options, simulation::scattered_points(path, 2, 40, 1), path};
}

inline MapperReport map_next(simulation::Simulation& simulation, Mapper& mapper) {
  KeyframeProposal* proposal = &simulation.propose(mapper.graph());
  return mapper.step(std::span(&proposal, 1));
}

/// Rounds of the same place, `laps` of kBrowsedLap keyframes, by a tracker that forgets points out of sight.
inline constexpr int kBrowsedLap = 120;
[[nodiscard]] nlohmann::json browse(int laps);

}  // namespace twofold
