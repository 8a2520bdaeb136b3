#include "slam/map_movements.hpp"

#include <algorithm>
#include <utility>

namespace twofold {
namespace {

/// `later` comes after what is in `all`.
void add(const MapMovement& later, MapMovement& all) {
  all.version = later.version;
  all.keyframes = std::max(all.keyframes, later.keyframes);
  all.joined = std::max(all.joined, later.joined);
  all.farthest = std::max(all.farthest, later.farthest);
  all.most_turned = std::max(all.most_turned, later.most_turned);
  if (later.loop_to == kNoKeyframe) return;
  all.loop_from = later.loop_from;
  all.loop_to = later.loop_to;
}

}  // namespace

void MapMovements::found(const ClosedLoop& loop) {
  (void)loops_.try_push({loop.constraint.from, loop.constraint.to});  // full: an event does without its loop
}

void MapMovements::made(const GraphSnapshot& graph, const DoubleWindow& window) {
  MapMovement movement;
  movement.version = graph.version();
  if (graph.last_change().version > before_.version()) {
    for (std::uint32_t k = 0; k < before_.keyframe_count(); ++k) compare(graph, KeyframeId{k}, movement);
  } else {
    for (const auto& node : window.nodes) compare(graph, node.id, movement);
  }
  find_loops(graph, movement);
  before_ = graph;
  if (unsent_) {
    add(movement, *unsent_);
    movement = *std::exchange(unsent_, std::nullopt);
  }
  if (!movements_.try_push(MapMovement(movement))) unsent_ = movement;
}

void MapMovements::compare(const GraphSnapshot& graph, KeyframeId id, MapMovement& movement) const {
  if (!before_.contains(id)) return;
  const Keyframe& old = before_.keyframe(id);
  const Keyframe& now = graph.keyframe(id);
  if (old.culled() || now.culled()) return;
  if (old.part != now.part) {
    ++movement.keyframes;
    ++movement.joined;
    return;
  }
  const SE3 change = now.T_k_w * old.T_k_w.inverse();  // of the keyframe itself, wherever the origin is
  const double moved = change.translation().norm(), turned = change.so3().log().norm();
  movement.keyframes += moved >= kCorrection || turned >= kCorrectionAngle;
  movement.farthest = std::max(movement.farthest, moved);
  movement.most_turned = std::max(movement.most_turned, turned);
}

void MapMovements::find_loops(const GraphSnapshot& graph, MapMovement& movement) {
  for (LoopEnds loop; loops_.try_pop(loop);) {
    if (awaited_.size() == kLoops) awaited_.erase(awaited_.begin());  // lost on its way to the mapper
    awaited_.push_back(loop);
  }
  std::erase_if(awaited_, [&](const LoopEnds& loop) {
    const Keyframe& from = graph.keyframe(loop.from);
    if (from.culled() || graph.keyframe(loop.to).culled()) return true;
    if (find_edge(from, loop.to) == nullptr) return false;  // not taken yet
    newest_loop_ = loop;
    return true;
  });
  if (graph.last_change().version <= before_.version()) return;
  // The whole pose graph is optimised for the loop before it: such a version has that loop, too.
  movement.loop_from = newest_loop_.from;
  movement.loop_to = newest_loop_.to;
}

MapMovement MapMovements::take(std::uint64_t version) {
  MapMovement all;
  for (std::size_t n = 0; n <= kMovements; ++n) {
    if (!early_) {
      MapMovement next;
      if (!movements_.try_pop(next)) break;
      early_ = next;
    }
    if (early_->version > version) break;
    add(*early_, all);
    early_.reset();
  }
  return all;
}

}  // namespace twofold
