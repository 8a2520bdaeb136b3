// What it costs the viewer's thread to read a map: map_reading MAP.tfm [ROUNDS]
// Keyframes, points and edges, as they are read five times a second at most; and the points' standard
// deviations (PointDeviations), which the colours need and which are read once a second at most. Processor
// time, and the share of a core that the rests between two readings (viewer/viewer.cpp: 60 and 120 times what
// one took) leave of it.
#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <exception>
#include <memory>
#include <vector>

#include "base/processor_time.hpp"
#include "graph/map_file.hpp"
#include "slam/map_snapshot.hpp"
#include "viewer/scene.hpp"

namespace twofold {
namespace {

struct Cost {
  double least = 0, median = 0, most = 0;  // [ms]
};

template <class Work>
Cost cost_of(int rounds, const Work& work) {
  std::vector<double> ms;
  for (int n = 0; n < rounds; ++n) {
    const std::int64_t begin_ns = thread_cpu_ns();
    work();
    ms.push_back(1e-6 * static_cast<double>(thread_cpu_ns() - begin_ns));
  }
  std::sort(ms.begin(), ms.end());
  return {ms.front(), ms[ms.size() / 2], ms.back()};
}

void print(const char* what, const Cost& cost, double rest, double least_period_ms) {
  const double period = std::max(least_period_ms, rest * cost.median) + cost.median;
  std::printf("%-20s median %8.2f ms (%.2f to %.2f), at most every %6.0f ms: %.2f %% of a core\n", what,
              cost.median, cost.least, cost.most, period, 100 * cost.median / period);
}

void run(const char* file, int rounds) {
  SavedMap saved = load_map(file);
  auto version = std::make_shared<MapVersion>();
  version->graph = std::move(saved.graph);
  const MapSnapshot map(std::make_shared<const MapSnapshot::Impl>(MapSnapshot::Impl{saved.rig, version}));
  std::size_t points = 0;
  const Cost reading = cost_of(rounds, [&] { points = view_of(map, 0, false).points.size(); });
  PointDeviations deviations;
  const Cost finding = cost_of(rounds, [&] { deviations.find(map); });
  std::printf("%zu points, %zu keyframes, %d rounds\n", points, map.keyframes().size(), rounds);
  print("map", reading, 60, 200);
  print("standard deviations", finding, 120, 1000);
  std::printf("%.2f us a point with its covariance, %.2f without\n",
              1e3 * finding.median / static_cast<double>(points),
              1e3 * reading.median / static_cast<double>(points));
}

}  // namespace
}  // namespace twofold

int main(int argc, char** argv) try {
  if (argc < 2) {
    std::fprintf(stderr, "map_reading MAP.tfm [ROUNDS]\n");
    return 2;
  }
  twofold::run(argv[1], std::max(1, argc > 2 ? std::atoi(argv[2]) : 20));
} catch (const std::exception& error) {
  std::fprintf(stderr, "%s\n", error.what());
  return 2;
}
