#pragma once

#include <cstdint>
#include <deque>
#include <functional>
#include <optional>
#include <vector>

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
  bool changed = false;   ///< all poses were corrected: a loop, or the pose graph
  bool followed = false;  ///< the mesh has moved as the correction says
};

/// The mesh of the map part that the reference keyframe is in, kept up to date while the run lasts, and how
/// far it is behind the map: from when a version is published until all its keyframes are in the mesh, and
/// all submaps that moved by more than kAtOnce are joined where they are now. Submaps that moved by less, or
/// whose keyframes moved against each other, may follow later.
class LiveMesh {
 public:
  /// Told of the mesh each time it changed, on the thread that calls update.
  using Listener = std::function<void(const MeshPieces& mesh, KeyframeId part)>;

  LiveMesh(const SurfaceOptions& options, Listener listener)
      : composition_(options, kAtOnce), listener_(std::move(listener)) {}

  /// The mapper's thread, when a map is published: a clock is read, and a ring written.
  void published(const GraphSnapshot& graph);

  /// The surface's thread, during an update, too: if all poses were corrected since the last call, moves the
  /// mesh with the submaps (Composition::move_mesh), which takes a few hundredths of a second.
  void follow(const SubmapSurface& surface, const GraphSnapshot& graph);
  /// The surface's thread, or whoever ended it: makes the mesh what the submaps are now, in this map, or
  /// where they are in the map that was followed meanwhile.
  /// @param gives_up  as of Composition::update
  /// @return  false: it gave up
  bool update(const SubmapSurface& surface, const GraphSnapshot& graph,
              const Composition::GivesUp& gives_up = {});
  /// The surface's thread, where time is left: what has moved by little and was not joined anew for it yet
  /// is, one submap at a time, by the next update.
  /// @return  whether there is any
  bool rejoin_farthest(const SubmapSurface& surface);
  /// After the run.
  [[nodiscard]] LiveMeshFigures figures() const;

 private:
  /// [voxels] What moves farther is joined anew before new keyframes are in the mesh. Two images of a wall
  /// that are this far apart are still averaged into one, not two walls.
  static constexpr double kAtOnce = 2;

  void read_times();
  void take_followed(std::uint64_t version);
  void take_times(std::uint64_t version);
  void tell(KeyframeId part);
  void take_settled(const SubmapSurface& surface);

  Composition composition_;
  KeyframeId part_ = kNoKeyframe;  // that it is of
  Listener listener_;
  std::uint64_t revision_ = 0;             // that the listener knows
  SpscRing<MapTime> times_{4096};          // mapper -> surface
  std::uint64_t last_change_ = 0;          // mapper's
  std::deque<MapTime> map_times_;          // of maps that the mesh is not of yet
  std::uint64_t followed_ = 0;             // correction of all poses that the mesh has moved with
  std::vector<PlacedVolume> followed_to_;  // where submaps were then; until the end of an update
  LatencyHistogram behind_, loops_, joined_;
  std::optional<std::int64_t> unsettled_ns_;  // since when submaps that a correction bent may wait
  LatencyHistogram settled_;
  std::int64_t updates_ = 0, cpu_ns_ = 0;
  std::size_t blocks_ = 0, most_bytes_ = 0;
};

}  // namespace twofold
