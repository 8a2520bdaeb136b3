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
  std::size_t keyframes = 0;  ///< ever made
  bool changed = false;       ///< a map change came with it: a loop, the pose graph, joined parts
  /// Composition::of_new().made when all that is new in it is in the mesh; nothing: depth of its keyframes is
  /// missing.
  std::optional<std::uint64_t> made_until = {};
};

/// The mesh of the map part that the reference keyframe is in, kept up to date while the run lasts, and how
/// far it is behind the map: from when a version is published until the depth of all its keyframes is in the
/// mesh, and the mesh of what moved by more than kAtOnce has moved.
///
/// A map change moves the mesh at once; then the blocks of what moved are made anew, some with each update.
class LiveMesh {
 public:
  /// Told of the mesh each time it changed, on the thread that calls update.
  using Listener = std::function<void(const MeshPieces& mesh, KeyframeId part)>;

  LiveMesh(const SurfaceOptions& options, Listener listener)
      : composition_(options, kAtOnce), listener_(std::move(listener)) {}

  /// The mapper's thread, when a map is published: a clock is read, and a ring written.
  void published(const GraphSnapshot& graph);

  /// The surface's thread, or whoever ended it: the mesh gets what is new in the submaps, which have made a
  /// step with this map.
  /// @param most  as of Composition::update
  void update(const SubmapSurface& surface, const GraphSnapshot& graph, std::size_t most);
  /// What has moved by more than half a voxel waits to be made anew.
  /// @return  whether there is any
  bool rejoin(const SubmapSurface& surface);
  /// Whether blocks wait for updates.
  [[nodiscard]] bool unfinished() const { return composition_.unfinished(); }
  /// Whether any of them holds something new, or is of a submap that moved by more than kAtOnce.
  [[nodiscard]] bool urgent() const;
  /// After the run.
  [[nodiscard]] LiveMeshFigures figures() const;

 private:
  /// [voxels] The mesh has moved with what moved farther before it counts as that of the map's version. Two
  /// copies of a wall that are this far apart are still averaged into one.
  static constexpr double kAtOnce = 2;

  struct Change {
    std::int64_t published_ns = 0;
    std::optional<std::uint64_t>
        made_until;  ///< Composition::of_moved().made when what it moved is joined anew
  };

  /// Of another part: nothing of the one before is left.
  void begin(KeyframeId part);
  /// If all poses were moved since the last update.
  void follow_change(const SubmapSurface& surface, const GraphSnapshot& graph);
  void tell();
  void read_times();
  void take_times(const SubmapSurface& surface, std::uint64_t version);
  void take_joined();
  void take_settled(const SubmapSurface& surface);

  Composition composition_;
  KeyframeId part_ = kNoKeyframe;  // that it is of
  Listener listener_;
  std::uint64_t revision_ = 0;     // that the listener knows
  SpscRing<MapTime> times_{4096};  // mapper -> surface
  std::uint64_t last_change_ = 0;  // mapper's
  std::uint64_t followed_ = 0;     // version of the last map change that the mesh has followed
  std::deque<MapTime> map_times_;  // of maps that the mesh is not of yet
  LatencyHistogram behind_, moved_, joined_, settled_;
  std::deque<Change> unjoined_;               // by more than kAtOnce
  std::optional<std::int64_t> unsettled_ns_;  // since when what a map change bent may wait
  std::int64_t updates_ = 0, cpu_ns_ = 0;
  std::size_t blocks_ = 0, most_bytes_ = 0;
};

}  // namespace twofold
