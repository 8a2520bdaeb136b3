#include <algorithm>
#include <atomic>
#include <iterator>
#include <mutex>
#include <optional>
#include <stdexcept>
#include <utility>

#include "base/option_check.hpp"
#include "slam/conversions.hpp"
#include "slam/depth_frame.hpp"
#include "slam/distance_field.hpp"
#include "slam/map_snapshot.hpp"
#include "slam/surface_pieces.hpp"
#include "surface/composition.hpp"
#include "surface/meshing.hpp"
#include "surface/submaps.hpp"
#include "twofold/surface.hpp"

namespace twofold {

std::string MapSurfaceOptions::invalid_reason() const {
  if (std::string reason = model.invalid_reason(); !reason.empty()) return "model." + reason;
  return OptionCheck().above("memory_mb", memory_mb, 0).reason();
}

struct TWOFOLD_HIDDEN SurfaceSnapshot::Impl {
  /// Of all submaps, in the world.
  struct Joined {
    Joined(const SurfaceOptions& options, const std::vector<SharedSubmap>& submaps)
        : volume(options), free(options, 0) {
      for (const SharedSubmap& submap : submaps) {
        volume.add(*submap.volume, submap.T_w_s);
        free.add(*submap.free, submap.T_w_s);
      }
    }
    SurfaceVolume volume;
    FreeSpace free;
  };

  Impl(const SurfaceOptions& its_options, std::vector<SharedSubmap> its_submaps,
       std::shared_ptr<const MapVersion> its_map, KeyframeId its_part)
      : options(its_options), submaps(std::move(its_submaps)), map(std::move(its_map)), part(its_part) {}

  [[nodiscard]] const Joined& joined() const {
    if (const Joined* there = ready_.load(std::memory_order_acquire)) return *there;
    const std::scoped_lock lock(mutex_);
    if (!joined_) joined_.emplace(options, submaps);
    ready_.store(&*joined_, std::memory_order_release);
    return *joined_;
  }
  [[nodiscard]] std::size_t bytes() const {
    std::size_t sum = sizeof(Impl);
    for (const SharedSubmap& submap : submaps) sum += submap.volume->bytes() + submap.free->bytes();
    const Joined* there = ready_.load(std::memory_order_acquire);
    return there != nullptr ? sum + there->volume.bytes() + there->free.bytes() : sum;
  }

  const SurfaceOptions options;
  const std::vector<SharedSubmap> submaps;
  const std::shared_ptr<const MapVersion> map;
  const KeyframeId part;

 private:
  mutable std::mutex mutex_;  // guards joined_ until it is there; then it does not change
  mutable std::optional<Joined> joined_;
  mutable std::atomic<const Joined*> ready_{nullptr};  // joined_, whose making this publishes
};

namespace {

/// A keyframe of `older` to say where one of `newer` would be: the one that shares most points with it, else
/// the newest. None of other parts, or culled since.
std::optional<KeyframeId> keyframe_beside(const GraphSnapshot& older, const GraphSnapshot& newer,
                                          KeyframeId id, KeyframeId part) {
  const KeyframeId newer_part = newer.part(id);
  const auto is_in_both = [&](KeyframeId other) {
    return older.contains(other) && newer.contains(other) && !newer.keyframe(other).culled() &&
           newer.part(other) == newer_part && older.part(other) == part;
  };
  const Edge* best = nullptr;
  for (const Edge& edge : *newer.keyframe(id).edges)
    if (is_in_both(edge.other) && (best == nullptr || edge.weight > best->weight)) best = &edge;
  if (best != nullptr) return best->other;
  for (std::size_t n = older.keyframe_count(); n-- > 0;)
    if (const KeyframeId other{static_cast<std::uint32_t>(n)}; is_in_both(other)) return other;
  return std::nullopt;
}

/// T_k_w of a keyframe in the world that a part of `older` had, also of one that only `newer` has. Nothing
/// where it cannot be known.
std::optional<SE3> pose_in_older(const GraphSnapshot& older, const GraphSnapshot& newer, KeyframeId id,
                                 KeyframeId part) {
  if (older.contains(id)) return older.part(id) == part ? std::optional(older.T_k_w(id)) : std::nullopt;
  if (!newer.contains(id)) return std::nullopt;
  const auto live = newer.live_replacement(id);
  if (!live) return std::nullopt;
  const auto beside = keyframe_beside(older, newer, live->id, part);
  if (!beside) return std::nullopt;
  const SE3 T_k_beside = newer.T_k_w(id) * newer.T_k_w(*beside).inverse();
  return T_k_beside * older.T_k_w(*beside);
}

}  // namespace

SurfaceSnapshot::SurfaceSnapshot() = default;
SurfaceSnapshot::SurfaceSnapshot(std::shared_ptr<const Impl> impl) : impl_(std::move(impl)) {}
SurfaceSnapshot::~SurfaceSnapshot() = default;
SurfaceSnapshot::SurfaceSnapshot(const SurfaceSnapshot&) = default;
SurfaceSnapshot& SurfaceSnapshot::operator=(const SurfaceSnapshot&) = default;

std::uint64_t SurfaceSnapshot::map_version() const {
  return impl_ ? impl_->map->graph.version() : 0;
}

std::uint32_t SurfaceSnapshot::map_part() const {
  return impl_ ? index(impl_->part) : kNoId;
}

std::optional<Pose> SurfaceSnapshot::camera_pose(const PoseEstimate& pose, const MapSnapshot& map) const {
  if (!impl_ || pose.state != TrackingState::kTracked) return std::nullopt;
  const KeyframeId reference{pose.reference_keyframe};
  const auto T_k_w = pose_in_older(impl_->map->graph, map.impl_->map->graph, reference, impl_->part);
  if (!T_k_w) return std::nullopt;
  return to_pose(T_k_w->inverse() * to_se3(pose.T_reference_camera));
}

void SurfaceSnapshot::prepare() const {
  if (impl_) (void)impl_->joined();
}

SpacePoint SurfaceSnapshot::at(const std::array<double, 3>& p_world) const {
  if (!impl_) return {};
  const Impl::Joined& joined = impl_->joined();
  return space_point(joined.volume, joined.free, p_world);
}

DistanceField SurfaceSnapshot::distances(const DistanceBox& box) const {
  if (const std::string why = box.invalid_reason(); !why.empty()) throw std::invalid_argument("box." + why);
  if (!impl_) {
    SurfaceOptions options;
    options.depth_noise = 1;  // of no depth image
    return distance_field(SurfaceVolume(options), FreeSpace(options, 0), box);
  }
  const Impl::Joined& joined = impl_->joined();
  return distance_field(joined.volume, joined.free, box);
}

SurfaceMesh SurfaceSnapshot::mesh() const {
  return impl_ ? to_surface_mesh(extract_mesh(impl_->joined().volume)) : SurfaceMesh();
}

std::size_t SurfaceSnapshot::memory_bytes() const {
  return impl_ ? impl_->bytes() : 0;
}

struct TWOFOLD_HIDDEN MapSurface::Impl {
  Impl(const MapSnapshot::Impl& map, const SurfaceModelOptions& its_options, const SubmapOptions& limits)
      : rig(expect_depth(map.rig)),
        row_offset(map.row_offset),
        min_stereo_depth(its_options.min_stereo_depth),
        options(surface_options(rig, its_options)),
        submaps(rig, options, limits),
        composition(options) {}

  void publish(const std::shared_ptr<const MapVersion>& map);
  /// What has been counted since the last call.
  [[nodiscard]] SurfaceUpdate take_counts();
  void note_bytes() { bytes.store(submaps.bytes() + composition.bytes(), std::memory_order_relaxed); }

  Rig rig;
  std::shared_ptr<const std::atomic<double>> row_offset;  ///< of the run; null: of none
  double min_stereo_depth;
  SurfaceOptions options;
  SubmapSurface submaps;
  Composition composition;               ///< of the part that the camera was in, for mesh_changes
  KeyframeId camera_part = kNoKeyframe;  ///< in which the camera was in the last update
  SubmapReport counted;                  ///< as far as updates have told
  std::int64_t newest_frame = -1;
  std::uint64_t version = 0;
  std::atomic<std::size_t> bytes{0};  // of both, for other threads. Relaxed: nothing goes with the number

  using OfPart = std::shared_ptr<const SurfaceSnapshot::Impl>;
  std::mutex mutex;               // guards what follows, while a pointer is copied or a list exchanged
  std::vector<OfPart> published;  ///< of each map part, first that of the camera
};

void MapSurface::Impl::publish(const std::shared_ptr<const MapVersion>& map) {
  const GraphSnapshot& graph = map->graph;
  if (graph.reference() == kNoKeyframe) return;
  std::vector<SharedSubmap> rest = submaps.share();
  std::vector<OfPart> next;
  for (KeyframeId part = graph.part(graph.reference());; part = rest.front().part) {
    std::vector<SharedSubmap> of_part;
    const auto end = std::stable_partition(rest.begin(), rest.end(),
                                           [&](const SharedSubmap& submap) { return submap.part != part; });
    std::move(end, rest.end(), std::back_inserter(of_part));
    rest.erase(end, rest.end());
    next.push_back(std::make_shared<const SurfaceSnapshot::Impl>(options, std::move(of_part), map, part));
    if (rest.empty()) break;
  }
  const std::scoped_lock lock(mutex);
  published.swap(next);  // those before, if nobody else has them, are destroyed after the lock
}

SurfaceUpdate MapSurface::Impl::take_counts() {
  const SubmapReport& now = submaps.report();
  SurfaceUpdate update;
  update.fused_anew = now.fused_anew - counted.fused_anew;
  update.fused = now.fused - counted.fused - update.fused_anew;
  update.no_readings = now.without_readings - counted.without_readings;
  update.beyond_memory = now.beyond_memory - counted.beyond_memory;
  update.discarded = now.not_in_map - counted.not_in_map;
  update.overtaken = now.overtaken - counted.overtaken;
  update.waiting = static_cast<int>(submaps.waiting());
  counted = now;
  return update;
}

namespace {

SubmapOptions submap_options(const MapSurfaceOptions& options, std::uint32_t loaded_keyframes) {
  if (const std::string why = options.invalid_reason(); !why.empty())
    throw std::invalid_argument("options." + why);
  SubmapOptions limits;
  limits.memory_mb = options.memory_mb;
  limits.first_keyframe = loaded_keyframes;
  limits.free_space = true;
  limits.max_free_depth = options.model.max_free_depth;
  return limits;
}

}  // namespace

MapSurface::MapSurface(const MapSnapshot& map, const MapSurfaceOptions& options)
    : impl_(new Impl(*map.impl_, options.model, submap_options(options, map.impl_->loaded_keyframes))) {}
MapSurface::~MapSurface() = default;
MapSurface::MapSurface(MapSurface&&) noexcept = default;
MapSurface& MapSurface::operator=(MapSurface&&) noexcept = default;

void MapSurface::add(const FrameView& frame, std::int64_t number) {
  if (number <= impl_->newest_frame)
    throw std::invalid_argument("number " + std::to_string(number) + " comes after " +
                                std::to_string(impl_->newest_frame));
  PairMatching matching{.min_depth = impl_->min_stereo_depth};
  if (impl_->row_offset) matching.row_offset = impl_->row_offset->load(std::memory_order_relaxed);
  const DepthFrame images = depth_frame(impl_->rig, frame, matching);
  impl_->submaps.offer(pack_keyframe_depth(number, images.depth, images.colour));
  impl_->newest_frame = number;
  impl_->note_bytes();
}

SurfaceUpdate MapSurface::update(const MapSnapshot& map) {
  const GraphSnapshot& graph = map.impl_->map->graph;
  if (graph.version() < impl_->version)
    throw std::invalid_argument("the map is of version " + std::to_string(graph.version()) + ", after " +
                                std::to_string(impl_->version));
  impl_->submaps.step(graph);
  impl_->version = graph.version();
  if (graph.reference() != kNoKeyframe) impl_->camera_part = graph.part(graph.reference());
  impl_->note_bytes();
  impl_->publish(map.impl_->map);
  return impl_->take_counts();
}

SurfaceChanges MapSurface::mesh_changes(std::uint64_t since) {
  Composition& whole = impl_->composition;
  if (impl_->camera_part != kNoKeyframe) whole.update(impl_->submaps.placed(impl_->camera_part));
  impl_->note_bytes();
  return {whole.mesh().revision(), kBlockEdge * impl_->options.voxel, surface_pieces(whole.mesh(), since)};
}

SurfaceSnapshot MapSurface::snapshot() const {
  const std::scoped_lock lock(impl_->mutex);
  return impl_->published.empty() ? SurfaceSnapshot() : SurfaceSnapshot(impl_->published.front());
}

SurfaceSnapshot MapSurface::snapshot(std::uint32_t part) const {
  const std::scoped_lock lock(impl_->mutex);
  for (const Impl::OfPart& published : impl_->published)
    if (index(published->part) == part) return SurfaceSnapshot(published);
  return {};
}

std::size_t MapSurface::memory_bytes() const {
  return impl_->bytes.load(std::memory_order_relaxed);
}

}  // namespace twofold
