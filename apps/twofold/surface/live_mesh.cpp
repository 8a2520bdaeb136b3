#include "apps/twofold/surface/live_mesh.hpp"

#include <algorithm>

#include "base/processor_time.hpp"
#include "engine/stage_timer.hpp"

namespace twofold {

void LiveMesh::published(const GraphSnapshot& graph) {
  const std::uint64_t change = graph.last_change().version;
  // A full ring leaves a figure out.
  (void)times_.try_push({graph.version(), steady_now_ns(), change > last_change_});
  last_change_ = change;
}

void LiveMesh::follow(const SubmapSurface& surface, const GraphSnapshot& graph) {
  if (graph.reference() == kNoKeyframe || graph.last_change().version <= followed_) return;
  followed_ = graph.last_change().version;
  const KeyframeId part = graph.part(graph.reference());
  followed_to_ = surface.placed_in(graph, part);
  (void)composition_.move_mesh(followed_to_);
  tell(part);
  take_followed(graph.version());
}

bool LiveMesh::update(const SubmapSurface& surface, const GraphSnapshot& graph,
                      const Composition::GivesUp& gives_up) {
  if (graph.reference() == kNoKeyframe) return true;
  const KeyframeId part = part_ = graph.part(graph.reference());
  followed_to_.clear();
  const std::int64_t begin_ns = thread_cpu_ns();
  const std::size_t blocks = composition_.update(surface.placed(part), gives_up);
  if (blocks > 0) {
    ++updates_;
    blocks_ += blocks;
    cpu_ns_ += thread_cpu_ns() - begin_ns;
    most_bytes_ = std::max(most_bytes_, composition_.bytes());
  }
  if (composition_.unfinished()) return false;
  if (!followed_to_.empty()) (void)composition_.move_mesh(followed_to_);
  tell(part);
  take_times(graph.version());
  take_settled(surface);
  return true;
}

bool LiveMesh::rejoin_farthest(const SubmapSurface& surface) {
  return part_ != kNoKeyframe && composition_.rejoin_farthest(surface.placed(part_));
}

void LiveMesh::tell(KeyframeId part) {
  if (composition_.mesh().revision() == revision_) return;
  revision_ = composition_.mesh().revision();
  if (listener_) listener_(composition_.mesh(), part);
}

void LiveMesh::read_times() {
  for (MapTime time; times_.try_pop(time);) map_times_.push_back(time);
}

/// The mesh has moved as the corrections up to this version of the map say.
void LiveMesh::take_followed(std::uint64_t version) {
  read_times();
  const std::int64_t now_ns = steady_now_ns();
  for (MapTime& time : map_times_) {
    if (time.version > version) return;
    if (!time.changed || time.followed) continue;
    loops_.record(now_ns - time.published_ns);
    time.followed = true;
  }
}

/// The mesh is now that of this version of the map.
void LiveMesh::take_times(std::uint64_t version) {
  take_followed(version);
  const std::int64_t now_ns = steady_now_ns();
  for (; !map_times_.empty() && map_times_.front().version <= version; map_times_.pop_front()) {
    const MapTime& time = map_times_.front();
    behind_.record(now_ns - time.published_ns);
    if (!time.changed) continue;
    joined_.record(now_ns - time.published_ns);
    if (!unsettled_ns_) unsettled_ns_ = time.published_ns;
  }
}

/// All that corrections bent is fused anew now, from the oldest of those on.
void LiveMesh::take_settled(const SubmapSurface& surface) {
  if (!unsettled_ns_ || surface.bent() > 0) return;
  settled_.record(steady_now_ns() - *unsettled_ns_);
  unsettled_ns_.reset();
}

LiveMeshFigures LiveMesh::figures() const {
  const auto ms = [](std::int64_t ns) { return static_cast<double>(ns) * 1e-6; };
  LiveMeshFigures figures;
  figures.updates = updates_;
  if (updates_ > 0) {
    figures.blocks_an_update = static_cast<double>(blocks_) / static_cast<double>(updates_);
    figures.update_ms = ms(cpu_ns_) / static_cast<double>(updates_);
  }
  figures.maps = behind_.count();
  figures.behind_p50_ms = ms(behind_.quantile_ns(0.5));
  figures.behind_p99_ms = ms(behind_.quantile_ns(0.99));
  figures.behind_max_ms = ms(behind_.max_ns());
  figures.loops = loops_.count();
  figures.loop_max_ms = ms(loops_.max_ns());
  figures.joined_max_ms = ms(joined_.max_ns());
  figures.settled_max_ms = ms(settled_.max_ns());
  figures.memory_mb = static_cast<double>(most_bytes_) / (1 << 20);
  return figures;
}

}  // namespace twofold
