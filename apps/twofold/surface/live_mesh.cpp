#include "apps/twofold/surface/live_mesh.hpp"

#include <algorithm>
#include <utility>

#include "base/processor_time.hpp"
#include "engine/stage_timer.hpp"

namespace twofold {

void LiveMesh::published(const GraphSnapshot& graph) {
  const std::uint64_t change = graph.last_change().version;
  // A full ring leaves a figure out.
  (void)times_.try_push({graph.version(), steady_now_ns(), graph.keyframe_count(), change > last_change_});
  last_change_ = change;
}

void LiveMesh::update(const SubmapSurface& surface, const GraphSnapshot& graph, std::size_t most) {
  if (graph.reference() == kNoKeyframe) return;
  if (const KeyframeId part = graph.part(graph.reference()); part != part_) begin(part);
  const std::int64_t begin_ns = thread_cpu_ns();
  follow_change(surface, graph);
  const std::size_t blocks = composition_.update(surface.placed(part_), most);
  if (blocks > 0) {
    ++updates_;
    blocks_ += blocks;
    cpu_ns_ += thread_cpu_ns() - begin_ns;
  }
  tell();
  take_times(surface, graph.version());
  take_joined();
  take_settled(surface);
  if (blocks > 0 && !unfinished()) most_bytes_ = std::max(most_bytes_, composition_.bytes());
}

void LiveMesh::begin(KeyframeId part) {
  part_ = part;
  composition_ = Composition(composition_.whole().options(), kAtOnce);
  revision_ = 0;
  for (MapTime& time : map_times_) time.made_until.reset();
  for (Change& change : unjoined_) change.made_until.reset();
}

void LiveMesh::follow_change(const SubmapSurface& surface, const GraphSnapshot& graph) {
  if (graph.last_change().version <= followed_) return;
  followed_ = graph.last_change().version;
  (void)rejoin(surface);
  tell();
  read_times();
  const std::int64_t now_ns = steady_now_ns();
  for (MapTime& time : map_times_) {
    if (time.version > graph.version() || !std::exchange(time.changed, false)) continue;
    moved_.record(now_ns - time.published_ns);
    unjoined_.push_back({time.published_ns, {}});
    if (!unsettled_ns_) unsettled_ns_ = time.published_ns;
  }
}

bool LiveMesh::urgent() const {
  const auto waits = [](const Composition::Progress& of) { return of.made < of.marked; };
  return waits(composition_.of_new()) || waits(composition_.of_moved());
}

bool LiveMesh::rejoin(const SubmapSurface& surface) {
  return part_ != kNoKeyframe && composition_.rejoin(surface.placed(part_));
}

void LiveMesh::tell() {
  if (composition_.mesh().revision() == revision_) return;
  revision_ = composition_.mesh().revision();
  if (listener_) listener_(composition_.mesh(), part_);
}

void LiveMesh::read_times() {
  for (MapTime time; times_.try_pop(time);) map_times_.push_back(time);
}

/// All that is new in this version of the map is marked now, if the depth of its keyframes has come.
void LiveMesh::take_times(const SubmapSurface& surface, std::uint64_t version) {
  read_times();
  const Composition::Progress of_new = composition_.of_new();
  const std::int64_t now_ns = steady_now_ns();
  for (MapTime& time : map_times_)
    if (time.version <= version && time.keyframes <= surface.first_unfused() && !time.made_until)
      time.made_until = of_new.marked;
  const auto is_in = [&](const MapTime& time) { return time.made_until && *time.made_until <= of_new.made; };
  for (; !map_times_.empty() && is_in(map_times_.front()); map_times_.pop_front())
    behind_.record(now_ns - map_times_.front().published_ns);
}

void LiveMesh::take_joined() {
  const Composition::Progress of_moved = composition_.of_moved();
  for (Change& change : unjoined_)
    if (!change.made_until) change.made_until = of_moved.marked;
  for (; !unjoined_.empty() && *unjoined_.front().made_until <= of_moved.made; unjoined_.pop_front())
    joined_.record(steady_now_ns() - unjoined_.front().published_ns);
}

/// All that corrections bent is fused anew now, from the oldest of those on.
void LiveMesh::take_settled(const SubmapSurface& surface) {
  if (unsettled_ns_ && surface.bent() == 0 && !unfinished())
    settled_.record(steady_now_ns() - *std::exchange(unsettled_ns_, std::nullopt));
}

LiveMeshFigures LiveMesh::figures() const {
  const auto ms = [](std::int64_t ns) { return static_cast<double>(ns) * 1e-6; };
  const auto most_ms = [&](const LatencyHistogram& of, std::optional<std::int64_t> since_ns) {
    return ms(std::max(of.max_ns(), since_ns ? steady_now_ns() - *since_ns : 0));
  };
  LiveMeshFigures figures;
  figures.updates = updates_;
  if (updates_ > 0) {
    figures.blocks_an_update = static_cast<double>(blocks_) / static_cast<double>(updates_);
    figures.update_ms = ms(cpu_ns_) / static_cast<double>(updates_);
  }
  figures.maps = behind_.count();
  figures.behind_p50_ms = ms(behind_.quantile_ns(0.5));
  figures.behind_p99_ms = ms(behind_.quantile_ns(0.99));
  figures.behind_max_ms =
      most_ms(behind_, map_times_.empty() ? std::nullopt : std::optional(map_times_.front().published_ns));
  figures.loops = moved_.count();
  figures.loop_max_ms = ms(moved_.max_ns());
  figures.joined_max_ms =
      most_ms(joined_, unjoined_.empty() ? std::nullopt : std::optional(unjoined_.front().published_ns));
  figures.settled_max_ms = most_ms(settled_, unsettled_ns_);
  figures.memory_mb = static_cast<double>(std::max(most_bytes_, composition_.bytes())) / (1 << 20);
  return figures;
}

}  // namespace twofold
