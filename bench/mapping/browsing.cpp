// What browsing a mapped place does to memory: laps of the same circle.
#include <fmt/format.h>

#include <cstdio>
#include <memory>
#include <nlohmann/json.hpp>

#include "bench/mapping/simulated_run.hpp"
#include "fixtures/live_memory.hpp"

namespace twofold {
namespace {

using simulation::Simulation;

/// What is in the map, culled keyframes and points not counted.
struct MapSize {
  std::size_t keyframes = 0, points = 0, measurements = 0, edges = 0;
};

MapSize size_of(const GraphSnapshot& graph) {
  MapSize size;
  for (std::uint32_t k = 0; k < graph.keyframe_count(); ++k) {
    const Keyframe& keyframe = graph.keyframe(KeyframeId{k});
    size.keyframes += keyframe.culled() ? 0 : 1;
    size.measurements += keyframe.observations->size();
    size.edges += keyframe.edges->size();
  }
  size.edges /= 2;
  for (std::uint32_t p = 0; p < graph.point_count(); ++p) size.points += !graph.point(PointId{p}).culled();
  return size;
}

struct Lap {
  Samples round_ms;
  double heap = 0;  ///< change of what the mapper and its graph hold [bytes]
};

Lap run_lap(Simulation& simulation, Mapper& mapper) {
  Lap lap;
  for (int n = 0; n < kBrowsedLap; ++n) {
    KeyframeProposal* proposal = &simulation.propose(mapper.graph());
    const std::size_t before = live_heap_bytes();
    const double ms = mapper.step(std::span(&proposal, 1)).ms.total();
    lap.heap += static_cast<double>(live_heap_bytes()) - static_cast<double>(before);
    lap.round_ms.add(ms);
  }
  return lap;
}

}  // namespace

nlohmann::json browse(int laps) {
  const std::vector<SE3> path = simulation::circle_path(kBrowsedLap * laps, laps, 2.2, 1.2);
  simulation::Options options;
  options.rig = simulation::thesis_rig();
  options.global_association = false;
  options.max_observations = 180;
  Simulation simulation(options, simulation::scattered_points(path, 2, 40, 1), path);
  Mapper mapper(options.rig, mapper_options(25, 175), simulation.search(10));
  nlohmann::json out = nlohmann::json::array();
  double heap = 0;  // of the mapper and its graph, without the simulation [bytes]
  fmt::print("\nbrowsing: {} laps of {} keyframes\n{:>5} {:>9} {:>9} {:>9} {:>12} {:>9} {:>9} {:>9} {:>12}\n",
             laps, kBrowsedLap, "lap", "proposed", "keyframes", "points", "measurements", "edges", "heap MiB",
             "round ms", "resident MiB");
  for (int lap = 1; lap <= laps; ++lap) {
    const Lap driven = run_lap(simulation, mapper);
    heap += driven.heap;
    const MapSize size = size_of(mapper.graph());
    const double mib = heap / (1024 * 1024);
    if (lap <= 3 || lap % 10 == 0 || lap == laps) {
      fmt::print("{:5} {:9} {:9} {:9} {:12} {:9} {:9.3f} {:9.2f} {:12.1f}\n", lap, lap * kBrowsedLap,
                 size.keyframes, size.points, size.measurements, size.edges, mib, driven.round_ms.median(),
                 static_cast<double>(resident_bytes()) / (1024 * 1024));
      std::fflush(stdout);
    }
    out.push_back({{"lap", lap},
                   {"keyframes", size.keyframes},
                   {"points", size.points},
                   {"measurements", size.measurements},
                   {"edges", size.edges},
                   {"heap_mib", mib},
                   {"round_ms_median", driven.round_ms.median()}});
  }
  const auto at = [&](int lap) { return 1024 * 1024 * out.at(lap - 1)["heap_mib"].get<double>(); };
  if (laps >= 4) {
    fmt::print("          last half: {:.0f} bytes a proposed keyframe\n",
               (at(laps) - at(laps / 2)) / ((laps - laps / 2) * kBrowsedLap));
  }
  return out;
}

}  // namespace twofold
