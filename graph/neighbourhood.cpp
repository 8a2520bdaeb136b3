#include "graph/neighbourhood.hpp"

#include <algorithm>
#include <tuple>

#include "base/check.hpp"

namespace twofold {
namespace {

struct Candidate {
  int weight;
  KeyframeId id;
  int parent;

  bool operator<(const Candidate& other) const {
    return std::tuple(-weight, id, parent) < std::tuple(-other.weight, other.id, other.parent);
  }
};

void collect_edges(const GraphSnapshot& graph, const std::vector<TreeNode>& nodes, std::size_t begin,
                   std::size_t end, const VisitedSet& visited, std::vector<Candidate>& candidates) {
  candidates.clear();
  for (std::size_t n = begin; n < end; ++n) {
    const Keyframe& keyframe = graph.keyframe(nodes[n].id);
    if (!keyframe.edges) continue;
    for (const Edge& edge : *keyframe.edges) {
      if (visited.contains(index(edge.other))) continue;
      candidates.push_back({edge.weight, edge.other, static_cast<int>(n)});
    }
  }
  std::sort(candidates.begin(), candidates.end());
}

}  // namespace

void VisitedSet::reset(std::size_t size) {
  met_.clear();
  size_ = size;
}

bool VisitedSet::insert(std::uint32_t id) {
  TWOFOLD_CHECK(id < size_, "id beyond the size of the set");
  if (contains(id)) return false;
  met_.set(id, 0);
  return true;
}

void weighted_breadth_first(const GraphSnapshot& graph, KeyframeId root, std::size_t max_count,
                            VisitedSet& visited, std::vector<TreeNode>& result) {
  result.clear();
  visited.reset(graph.keyframe_count());
  if (max_count == 0 || !graph.contains(root)) return;
  visited.insert(index(root));
  result.push_back({root, -1});
  std::vector<Candidate> candidates;
  std::size_t level_begin = 0;
  while (level_begin < result.size() && result.size() < max_count) {
    const std::size_t level_end = result.size();
    collect_edges(graph, result, level_begin, level_end, visited, candidates);
    for (const Candidate& candidate : candidates) {
      if (result.size() == max_count) break;
      if (visited.insert(index(candidate.id))) result.push_back({candidate.id, candidate.parent});
    }
    level_begin = level_end;
  }
}

void for_each_component(const GraphSnapshot& graph,
                        const std::function<void(const std::vector<TreeNode>& tree)>& visit) {
  std::vector<KeyframeId> roots{graph.reference()};
  for (std::uint32_t k = 0; k < graph.keyframe_count(); ++k) roots.push_back(KeyframeId{k});
  IdMap met;
  VisitedSet visited;
  std::vector<TreeNode> tree;
  for (const KeyframeId root : roots) {
    if (!graph.contains(root) || met.contains(root) || graph.keyframe(root).culled()) continue;
    weighted_breadth_first(graph, root, graph.keyframe_count(), visited, tree);
    for (const TreeNode& node : tree) met.set(node.id, 0);
    visit(tree);
  }
}

void direct_neighbours(const GraphSnapshot& graph, KeyframeId id, std::size_t max_count,
                       std::vector<KeyframeId>& result) {
  const std::size_t begin = result.size();
  result.push_back(id);
  const Keyframe& keyframe = graph.keyframe(id);
  if (!keyframe.edges) return;
  for (const Edge& edge : *keyframe.edges) result.push_back(edge.other);
  std::sort(result.begin() + static_cast<std::ptrdiff_t>(begin) + 1, result.end(),
            [&](KeyframeId a, KeyframeId b) {
              return std::tuple(-find_edge(keyframe, a)->weight, a) <
                     std::tuple(-find_edge(keyframe, b)->weight, b);
            });
  if (result.size() > begin + max_count) result.resize(begin + max_count);
}

void visible_points(const GraphSnapshot& graph, std::span<const KeyframeId> keyframes, VisitedSet& visited,
                    std::vector<PointId>& result) {
  visited.reset(graph.point_count());
  for (const KeyframeId id : keyframes) {
    const Keyframe& keyframe = graph.keyframe(id);
    if (!keyframe.observations) continue;
    for (const Observation& observation : *keyframe.observations) {
      if (visited.insert(index(observation.point)) && !graph.point(observation.point).culled()) {
        result.push_back(observation.point);
      }
    }
  }
}

}  // namespace twofold
