#pragma once

#include <CLI/App.hpp>
#include <condition_variable>
#include <deque>
#include <memory>
#include <mutex>
#include <optional>
#include <utility>

#include "apps/twofold/surface/depth_out_of_range.hpp"
#include "apps/twofold/surface/frame_colours.hpp"
#include "apps/twofold/surface/live_mesh.hpp"
#include "apps/twofold/surface/surface_output.hpp"
#include "base/right_of_way.hpp"
#include "engine/engine.hpp"
#include "engine/spsc_ring.hpp"
#include "engine/worker.hpp"
#include "io/sources/frame_source.hpp"
#include "slam/map_lender.hpp"
#include "surface/submaps.hpp"

namespace twofold {

/// What `twofold run` is told about surfaces.
struct LiveSurfaceArguments {
  double voxel = 0;         ///< [m]; 0: no surface
  double memory_mb = 2000;  ///< of samples and depth images
  bool live_mesh = false;   ///< kept up to date while the run lasts, unless that has one thread
  double load = 0.5;        ///< share of one processor's time that the thread may take, in (0, 1]
  MeshFiles files;          ///< of the mesh at the end
};

/// --surface, --surface-memory, --surface-load and --surface-live, and --obj and --picture, which need it.
void add_live_surface_options(CLI::App& command, LiveSurfaceArguments& arguments);

/// What the tracker made of a frame.
struct KeyframeDecision {
  std::int64_t frame = 0;
  bool keyframe = false;  ///< it was proposed as one
  double row_offset = 0;  ///< rows that the right image lies lower than the left one [px]
};

/// The surface of `twofold run --surface`; nothing without that option.
///
/// A client of the engine, on a thread of its own that runs when the others leave time. The reader keeps the
/// images of frames that are under way (they are counted, not copied), until the tracker has said which of
/// them it wants as keyframes; those wait for the surface's thread, which gets their depth, reads snapshots
/// of the map, and fuses; while the tracker is at work it stands still, but where a library has the thread
/// (matching of pairs, image files). Nobody waits for it: the oldest of too many waiting frames is let go of,
/// and counted. Runs on one thread fuse between two frames, so that the same input gives the same bytes.
class LiveSurface {
 public:
  /// Adds its listeners to those of `options`, which are called as before, and takes its right_of_way, which
  /// must be null. source must outlive the object, and the object the run.
  /// Throws IoError for a source without depth, a voxel out of its range, or mesh files that have no folder.
  /// @param one_thread  the run is deterministic, or a replay
  /// @param on_mesh     asks for a mesh while the run lasts, on more than one thread; may be empty
  LiveSurface(const LiveSurfaceArguments& arguments, const FrameSource& source, EngineOptions& options,
              bool one_thread, LiveMesh::Listener on_mesh = {});

  /// The reader's thread, with each frame it reads.
  void show(const Frame& frame);

  /// Once, after the run, if wanted(): fuses what still waits, and anew what is bent, along the final map's
  /// poses, and extracts the mesh of map part `part`. Throws std::runtime_error with what the surface's
  /// thread failed of.
  [[nodiscard]] TriangleMesh finish(const GraphSnapshot& graph, KeyframeId part, SurfaceFigures& figures);
  [[nodiscard]] bool wanted() const { return surface_.has_value(); }

 private:
  static constexpr std::size_t kMostWaiting = 48;  // keyframes whose images wait for the surface's thread

  /// Frames and by how many rows their right images lie lower.
  using Keyframes = std::deque<std::pair<Frame, double>>;

  void listen(EngineOptions& options);
  void sort_frames();
  void work(const std::stop_token& stop);
  /// Takes the oldest of the frames that wait, and the newest map.
  /// @return  whether anything is left to do in it
  bool step(std::size_t most_frames = kMostWaiting);
  bool step_with_mesh(const GraphSnapshot& graph, bool is_new);
  void take(const Frame& frame, double row_offset);

  const LiveSurfaceArguments arguments_;
  Rig rig_;
  std::optional<SubmapSurface> surface_;  // the surface's thread's
  std::uint64_t version_ = 0;             // likewise: of the map it saw last
  int put_off_ = 0;                       // likewise: steps that left no time for bent submaps
  FrameColours colours_;                  // likewise
  DepthOutOfRange out_of_range_;          // likewise
  std::string defect_;                    // likewise: of the newest image that did not fit
  int unfit_ = 0;                         // likewise

  static constexpr std::size_t kMostDecisions = 256;      // more than frames are ever under way
  SpscRing<KeyframeDecision> decisions_{kMostDecisions};  // tracker -> reader
  std::deque<Frame> under_way_;                           // reader's
  RightOfWay right_of_way_;                               // set by the tracker, read by the surface
  MapLender maps_;
  std::unique_ptr<LiveMesh> mesh_;

  std::mutex mutex_;  // guards keyframes_ and overtaken_; taken by reader and surface alone
  Keyframes keyframes_;
  int overtaken_ = 0;
  std::condition_variable_any arrived_;
  std::optional<Worker> worker_;  // last: joins before what it uses is destroyed
};

}  // namespace twofold
