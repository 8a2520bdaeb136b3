#pragma once

#include <cstdint>
#include <functional>
#include <optional>

#include "apps/twofold/surface/surface_output.hpp"
#include "engine/latency_histogram.hpp"
#include "engine/spsc_ring.hpp"
#include "graph/snapshot.hpp"
#include "surface/composition.hpp"
#include "surface/submaps.hpp"

namespace twofold {

/// When a version of the map was published.
struct MapTime {
  std::uint64_t version = 0;
  std::int64_t published_ns = 0;
  bool changed = false;  ///< all poses were corrected: a loop, or the pose graph
};

/// The mesh of the map part that the reference keyframe is in, kept up to date while the run lasts, and how
/// far it is behind the map.
class LiveMesh {
 public:
  /// Told of the mesh each time it changed, on the thread that calls update.
  using Listener = std::function<void(const MeshPieces& mesh, KeyframeId part)>;

  LiveMesh(const SurfaceOptions& options, Listener listener)
      : composition_(options), listener_(std::move(listener)) {}

  /// The mapper's thread, when a map is published: a clock is read, and a ring written.
  void published(const GraphSnapshot& graph);

  /// The surface's thread, or whoever ended it: makes the mesh what the submaps are now, in this map.
  /// @param gives_up  as of Composition::update
  /// @return  false: it gave up
  bool update(const SubmapSurface& surface, const GraphSnapshot& graph,
              const Composition::GivesUp& gives_up = {});
  /// After the run.
  [[nodiscard]] LiveMeshFigures figures() const;

 private:
  void take_times(std::uint64_t version);
  void take_settled(const SubmapSurface& surface);

  Composition composition_;
  Listener listener_;
  std::uint64_t revision_ = 0;     // that the listener knows
  SpscRing<MapTime> times_{4096};  // mapper -> surface
  std::uint64_t last_change_ = 0;  // mapper's
  std::optional<MapTime> next_time_;
  LatencyHistogram behind_, loops_;
  std::optional<std::int64_t> unsettled_ns_;  // since when submaps that a correction bent may wait
  LatencyHistogram settled_;
  std::int64_t updates_ = 0, cpu_ns_ = 0;
  std::size_t blocks_ = 0, most_bytes_ = 0;
};

}  // namespace twofold
