#include "mapping/map_parts.hpp"

#include <algorithm>
#include <utility>

namespace twofold {
namespace {

std::size_t size_of(const GraphSnapshot& graph, KeyframeId part) {
  std::size_t count = 0;
  for (std::uint32_t k = 0; k < graph.keyframe_count(); ++k) {
    const Keyframe& keyframe = graph.keyframe(KeyframeId{k});
    count += keyframe.part == part && !keyframe.culled() ? 1 : 0;
  }
  return count;
}

}  // namespace

int join_parts(GraphWriter& writer, KeyframeId from, KeyframeId to, const SE3& T_to_from) {
  const GraphSnapshot& graph = writer.graph();
  KeyframeId moved = from, fixed = to;
  SE3 T_fixed_moved = T_to_from;
  const auto part = [&](KeyframeId id) { return graph.part(id); };
  if (part(moved) == part(fixed)) return 0;
  const std::size_t moved_size = size_of(graph, part(moved)), fixed_size = size_of(graph, part(fixed));
  if (moved_size > fixed_size || (moved_size == fixed_size && part(moved) < part(fixed))) {
    std::swap(moved, fixed);
    T_fixed_moved = T_fixed_moved.inverse();
  }
  const SE3 T_moved_w = T_fixed_moved.inverse() * graph.keyframe(fixed).T_k_w;
  const SE3 T_before_w = graph.keyframe(moved).T_k_w.inverse() * T_moved_w;
  const KeyframeId old_part = part(moved), new_part = part(fixed);
  int count = 0;
  for (std::uint32_t k = 0; k < graph.keyframe_count(); ++k) {
    const KeyframeId id{k};
    if (graph.keyframe(id).culled() || part(id) != old_part)
      continue;  // those go along with their replacements
    writer.set_part(id, new_part);
    writer.set_pose(id, graph.keyframe(id).T_k_w * T_before_w);
    ++count;
  }
  return count;
}

}  // namespace twofold
