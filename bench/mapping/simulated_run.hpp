#pragma once

#include <algorithm>
#include <nlohmann/json_fwd.hpp>
#include <span>
#include <vector>

#include "mapping/mapper.hpp"
#include "tests/mapping/simulation.hpp"

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
  options.sigma_scale = 2;  // one pixel of noise
  options.edge.sigma_px = 1;
  return options;
}

inline MapperReport map_next(simulation::Simulation& simulation, Mapper& mapper) {
  KeyframeProposal* proposal = &simulation.propose(mapper.graph());
  return mapper.step(std::span(&proposal, 1));
}

/// Rounds of the same place, `laps` of kBrowsedLap keyframes, by a tracker that forgets points out of sight.
inline constexpr int kBrowsedLap = 120;
[[nodiscard]] nlohmann::json browse(int laps);

}  // namespace twofold
