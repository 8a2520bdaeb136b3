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

bool LiveMesh::update(const SubmapSurface& surface, const GraphSnapshot& graph,
                      const Composition::GivesUp& gives_up) {
  if (graph.reference() == kNoKeyframe) return true;
  const KeyframeId part = graph.part(graph.reference());
  const std::int64_t begin_ns = thread_cpu_ns();
  const std::size_t blocks = composition_.update(surface.placed(part), gives_up);
  if (blocks > 0) {
    ++updates_;
    blocks_ += blocks;
    cpu_ns_ += thread_cpu_ns() - begin_ns;
    most_bytes_ = std::max(most_bytes_, composition_.bytes());
  }
  if (composition_.unfinished()) return false;
  take_times(graph.version());
  take_settled(surface);
  if (composition_.mesh().revision() != revision_) {
    revision_ = composition_.mesh().revision();
    if (listener_) listener_(composition_.mesh(), part);
  }
  return true;
}

/// The mesh is now that of this version of the map.
void LiveMesh::take_times(std::uint64_t version) {
  const std::int64_t now_ns = steady_now_ns();
  for (;;) {
    if (!next_time_) {
      MapTime time;
      if (!times_.try_pop(time)) return;
      next_time_ = time;
    }
    if (next_time_->version > version) return;
    behind_.record(now_ns - next_time_->published_ns);
    if (next_time_->changed) {
      loops_.record(now_ns - next_time_->published_ns);
      if (!unsettled_ns_) unsettled_ns_ = next_time_->published_ns;
    }
    next_time_.reset();
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
  figures.settled_max_ms = ms(settled_.max_ns());
  figures.memory_mb = static_cast<double>(most_bytes_) / (1 << 20);
  return figures;
}

}  // namespace twofold
