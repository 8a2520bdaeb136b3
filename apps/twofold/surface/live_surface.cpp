#include "apps/twofold/surface/live_surface.hpp"

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cmath>
#include <stdexcept>

#include <fmt/format.h>

#include "apps/command_line.hpp"
#include "base/check.hpp"
#include "base/processor_time.hpp"
#include "engine/listeners.hpp"
#include "imaging/row_offset.hpp"
#include "io/files/io_error.hpp"
#include "surface/meshing.hpp"
#include "surface/stereo/stereo_depth.hpp"

namespace twofold {
namespace {

constexpr std::size_t kMostFrames = 4;  // at a time: a tenth of a second
// From one look at what came to the next, about 30 ms:
constexpr std::size_t kMostBlocks = 1000;  // made anew
constexpr std::size_t kMostAnew = 2;       // keyframes of bent submaps, fused anew
constexpr int kMostPutOff = 10;            // looks after which these get a turn, whatever else waits
constexpr auto kMapCheck = std::chrono::milliseconds(20);

}  // namespace

void add_live_surface_options(CLI::App& command, LiveSurfaceArguments& arguments) {
  CLI::Option* surface = command
                             .add_option("--surface", arguments.voxel,
                                         "Fuse the keyframes' depth into a mesh (surface.ply, surface.glb), "
                                         "with samples this far apart [m]")
                             ->check(above_zero());
  command
      .add_option("--surface-memory", arguments.memory_mb,
                  "No more keyframes are fused once samples and depth images take this much [MiB]; joining "
                  "the submaps and the mesh at the end take beside it up to five times the samples, the more "
                  "the finer the voxels")
      ->check(above_zero())
      ->capture_default_str()
      ->needs(surface);
  command
      .add_option("--surface-load", arguments.load,
                  "Share of one processor's time that the surface may take while the run lasts; runs on one "
                  "thread (--deterministic, --replay-schedule) take what they need")
      ->check(CLI::Range(0.01, 1.0))
      ->capture_default_str()
      ->needs(surface);
  command
      .add_flag("--surface-live", arguments.live_mesh,
                "Keep the mesh up to date while the run lasts, and say how far it is behind the map; not on "
                "one thread")
      ->needs(surface);
  add_mesh_file_options(command, arguments.files);
  for (const char* option : {"--obj", "--picture"}) command.get_option(option)->needs(surface);
}

LiveSurface::LiveSurface(const LiveSurfaceArguments& arguments, const FrameSource& source,
                         EngineOptions& options, bool one_thread, LiveMesh::Listener on_mesh)
    : arguments_(arguments), rig_(source.rig()), colours_(source) {
  if (arguments.voxel == 0) return;
  expect_places_for(arguments.files);
  if (const std::string why = no_surface_reason(rig_); !why.empty())
    throw IoError("--surface", "the source " + why);
  SurfaceOptions surface;
  surface.voxel = arguments.voxel;
  surface.depth_noise = usual_depth_noise(rig_);
  SubmapOptions submaps;
  submaps.memory_mb = arguments.memory_mb;
  if (options.map) submaps.first_keyframe = static_cast<std::uint32_t>(options.map->graph.keyframe_count());
  if (const std::string reason = surface.invalid_reason(); !reason.empty())
    throw IoError("--surface", reason);
  surface_.emplace(rig_, surface, submaps);
  if (!one_thread && (arguments.live_mesh || on_mesh))
    mesh_ = std::make_unique<LiveMesh>(surface, std::move(on_mesh));
  listen(options);
  if (!one_thread) {
    worker_.emplace(WorkerOptions{.name = "surface", .time_slice = kPatientSlice},
                    [this](const std::stop_token& stop) { work(stop); });
  }
}

void LiveSurface::listen(EngineOptions& options) {
  TWOFOLD_CHECK(options.right_of_way == nullptr, "one client asks for the tracker's right of way");
  TWOFOLD_CHECK(options.frame_slots < kMostDecisions, "each frame under way has room for its decision");
  options.right_of_way = &right_of_way_;
  options.on_pose = both(
      options.on_pose, PoseListener([this](const PoseReport& report) {
        // Never full: the reader empties it before each frame it sends.
        (void)decisions_.try_push({report.record.frame_index, report.record.keyframe, report.row_offset});
      }));
  options.on_map =
      both(options.on_map, MapListener([this](const GraphSnapshot& graph, const DoubleWindow& window) {
             if (mesh_) mesh_->published(graph);
             maps_.publish(graph, window);
           }));
}

void LiveSurface::show(const Frame& frame) {
  if (!surface_) return;
  sort_frames();
  if (!worker_) (void)step();
  under_way_.push_back(frame);
}

/// Frames that the tracker has looked at are let go of, or wait as keyframes.
void LiveSurface::sort_frames() {
  bool any = false;
  for (KeyframeDecision decision; decisions_.try_pop(decision);) {
    while (!under_way_.empty() && under_way_.front().index < decision.frame)
      under_way_.pop_front();  // dropped
    if (under_way_.empty() || under_way_.front().index != decision.frame) continue;
    if (decision.keyframe) {
      const std::scoped_lock lock(mutex_);
      keyframes_.emplace_back(std::move(under_way_.front()), decision.row_offset);
      if (keyframes_.size() > kMostWaiting) {
        keyframes_.pop_front();
        ++overtaken_;
      }
      any = true;
    }
    under_way_.pop_front();
  }
  if (any) arrived_.notify_one();
}

void LiveSurface::work(const std::stop_token& stop) {
  yield_to_other_threads();
  const MakesWay makes_way(right_of_way_);
  bool any_left = false;
  while (!stop.stop_requested()) {
    if (!any_left) {
      std::unique_lock lock(mutex_);
      (void)arrived_.wait_for(lock, stop, kMapCheck, [this] { return !keyframes_.empty(); });
    }
    if (stop.stop_requested()) return;  // the caller takes the rest
    const std::int64_t begin_ns = thread_cpu_ns();
    any_left = step(kMostFrames);
    const double rest_ns = static_cast<double>(thread_cpu_ns() - begin_ns) * (1 / arguments_.load - 1);
    std::unique_lock lock(mutex_);
    (void)arrived_.wait_for(lock, stop, std::chrono::nanoseconds(std::llround(rest_ns)),
                            [] { return false; });
  }
}

bool LiveSurface::step(std::size_t most_frames) {
  Keyframes taken;
  {
    const std::scoped_lock lock(mutex_);
    for (; !keyframes_.empty() && taken.size() < most_frames; keyframes_.pop_front())
      taken.push_back(std::move(keyframes_.front()));
  }
  for (auto& [frame, row_offset] : taken) {
    take(frame, row_offset);
    frame = {};  // its images may be let go of
  }
  const auto map = maps_.newest();
  const bool is_new = !taken.empty() || map->graph.version() != version_;
  version_ = map->graph.version();
  if (mesh_) return step_with_mesh(map->graph, is_new);
  if (is_new || surface_->unfinished()) surface_->step(map->graph);
  return surface_->unfinished();
}

/// A little at a time, so that what comes next need not wait: what is new and what a loop moved, then submaps
/// that are bent, and last what has moved by little, as everything does all the time.
bool LiveSurface::step_with_mesh(const GraphSnapshot& graph, bool is_new) {
  const bool any_new = is_new || surface_->keyframes_left();
  if (any_new) surface_->step(graph, {.keyframes = kMostFrames, .anew = 0});
  if (any_new || mesh_->unfinished()) mesh_->update(*surface_, graph, kMostBlocks);
  if ((surface_->keyframes_left() || mesh_->urgent()) && ++put_off_ < kMostPutOff) return true;
  put_off_ = 0;
  if (surface_->bent() > 0) {
    surface_->step(graph, {.keyframes = 0, .anew = kMostAnew});
    mesh_->update(*surface_, graph, 0);
    return true;
  }
  return surface_->keyframes_left() || mesh_->unfinished() || mesh_->rejoin(*surface_);
}

void LiveSurface::take(const Frame& frame, double row_offset) {
  cv::Mat depth = frame.depth;
  if (rig_.kind == SensorKind::kStereo)
    depth = stereo_depth(rig_, frame.left, without_row_offset(frame.right, row_offset), kNearestStereo);
  const cv::Mat colour = colours_.left_image(frame);
  if (std::string defect = depth_defect(rig_, depth, colour); !defect.empty()) {
    defect_ = std::move(defect);
    ++unfit_;
    return;
  }
  out_of_range_.look_at(rig_, depth);
  surface_->offer(pack_keyframe_depth(frame.index, depth, colour), {depth, colour});
}

TriangleMesh LiveSurface::finish(const GraphSnapshot& graph, KeyframeId part, SurfaceFigures& figures) {
  if (worker_) {
    worker_->request_stop();
    const auto ended = worker_->join();
    worker_.reset();
    if (!ended) throw std::runtime_error(ended.error());
  }
  sort_frames();
  (void)step();
  if (mesh_) figures.live_mesh = mesh_->figures();
  surface_->step(graph);
  if (mesh_) mesh_->update(*surface_, graph, Composition::kAll);  // whoever is shown it keeps it
  mesh_.reset();                                                  // gives its memory to the whole
  const SurfaceVolume whole = surface_->whole(part);
  const std::int64_t begin_ns = thread_cpu_ns();
  TriangleMesh mesh = extract_mesh(whole);
  figures.mesh_ms = static_cast<double>(thread_cpu_ns() - begin_ns) * 1e-6;
  const SubmapReport& report = surface_->report();
  describe_volume(whole, figures);
  figures.submaps = surface_->submap_count();
  figures.fused = report.fused;
  figures.fused_anew = report.fused_anew;
  figures.fusion_ms = static_cast<double>(report.fusion_ns) * 1e-6 / std::max(1, report.fused);
  figures.memory_mb = static_cast<double>(report.most_bytes) / (1 << 20);
  figures.triangles = mesh.triangles.size();
  figures.colour = colours_.text();
  const auto left_out = [&](int count, const std::string& what) {
    if (count > 0) figures.left_out.push_back(fmt::format("{} {}", count, what));
  };
  left_out(report.without_readings, out_of_range_.text(rig_));
  left_out(report.culled,
           "keyframes at most, culled because others see the same: what they added stays until their submap "
           "is fused anew");
  left_out(report.submaps_dropped, "submaps all of whose keyframes were culled: others see the same");
  left_out(report.beyond_memory, "keyframes beyond the memory that the surface may take (--surface-memory)");
  left_out(report.overtaken + overtaken_, "keyframes, because the surface was behind (--surface-load)");
  left_out(unfit_, "images that did not fit: " + defect_);
  colours_.add_left_out(figures.left_out);
  left_out(report.not_in_map, "depth images whose frames are no keyframes of the map");
  return mesh;
}

}  // namespace twofold
