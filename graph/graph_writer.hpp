#pragma once

#include <cstddef>
#include <deque>
#include <span>

#include "graph/snapshot.hpp"

namespace twofold {

/// The one place where the SLAM graph changes. Owned by the mapper; single-threaded.
///
/// Works on a private version. publish() seals it as a snapshot in O(1); later changes copy only the chunks
/// they touch.
class GraphWriter {
 public:
  /// An empty graph; its first published version has number 1.
  GraphWriter() { graph_.version_ = 1; }
  /// Continues from an existing graph, e.g. a loaded map, with the next version number.
  explicit GraphWriter(const GraphSnapshot& graph) : graph_(graph) {
    ++graph_.version_;
    list_replacements();
  }

  /// The private version as it stands, with the version number it will be published under.
  [[nodiscard]] const GraphSnapshot& graph() const { return graph_; }
  /// Seals the private version and starts the next one.
  [[nodiscard]] GraphSnapshot publish();

  /// Appends a keyframe; its id must be graph().keyframe_count(). Lists may be null and are then empty.
  void add_keyframe(Keyframe keyframe);
  /// Appends a keyframe that was culled. The keyframe `replacement` names may be appended later;
  /// Replacement{} says that it is forgotten. Call keep_needed_replacements when all are there.
  void add_culled_keyframe(const Replacement& replacement);
  /// Appends `count` keyframes that were culled and are forgotten; O(1), and they take no memory.
  void add_forgotten_keyframes(std::size_t count);
  /// Appends a point without observers; ids skipped by the tracker are filled with culled points.
  void add_point(PointId id, MapPoint point);
  /// Appends culled points up to `count` points in all; O(1), and they take no memory.
  void fill_with_culled_points(std::size_t count) { graph_.points_.extend(count); }

  void set_pose(KeyframeId id, const SE3& T_k_w) { graph_.keyframes_.mutate(index(id)).T_k_w = T_k_w; }
  /// Moves a keyframe that is not culled to another part; its T_k_w then refers to that part's world frame.
  void set_part(KeyframeId id, KeyframeId part) { graph_.keyframes_.mutate(index(id)).part = part; }
  /// Multiplies the relative pose that a culled keyframe has to its replacement, which must not be forgotten,
  /// by another unit of length.
  void scale_replacement(KeyframeId id, double factor);
  void set_median_depth(KeyframeId id, double depth) {
    graph_.keyframes_.mutate(index(id)).median_depth = depth;
  }
  void set_inverse_depth(PointId id, const Vector3& psi) { graph_.points_.mutate(index(id)).psi = psi; }
  void set_misses(PointId id, std::uint8_t misses) { graph_.points_.mutate(index(id)).misses = misses; }
  void set_reference(KeyframeId id) { graph_.reference_ = id; }
  /// Says that all poses change with the version being made.
  void announce_change(MapChange::Kind kind) { graph_.last_change_ = {graph_.version_, kind}; }

  /// Adds observations to a keyframe, or replaces those of the same points, and registers it as an observer
  /// of the points.
  void add_observations(KeyframeId id, std::span<const Observation> observations);
  /// Removes the observations of the given points (ascending) from a keyframe.
  void remove_observations(KeyframeId id, std::span<const PointId> points);

  /// Adds the edge to both keyframes or replaces it; `edge` is as seen from `id`.
  void set_edge(KeyframeId id, const Edge& edge);
  void remove_edge(KeyframeId id, KeyframeId other);

  /// Removes all observations of a point and marks it culled; nothing happens to a point culled before.
  void cull_point(PointId id);
  /// Removes a keyframe and all it has; only its pose relative to `replacement`, which must not be culled, is
  /// known until it is forgotten. Points anchored in it keep anchor, psi and appearance: the anchor's frame
  /// goes along with the replacement (GraphSnapshot::T_k_w). The reference keyframe cannot be culled.
  void cull_keyframe(KeyframeId id, KeyframeId replacement);
  /// Makes the first keyframe along a culled one's chain of replacements that is not culled its replacement.
  /// Its pose stays; asking for it no longer walks along the chain.
  void shorten_replacements(KeyframeId id);

  /// Forgets the replacements of culled keyframes that no point is anchored in, but for the `keep`
  /// culled last. Looks at no more than `visits` of them, the oldest first, and goes on from there in the
  /// next call. Called with more visits than keyframes were culled since the last call, it keeps the number
  /// of replacements near `keep` plus that of culled anchors.
  void forget_replacements(std::size_t keep, std::size_t visits = 8);
  /// Forgets all replacements but those of keyframes that points are anchored in. Cost grows with the
  /// map.
  void keep_needed_replacements() {
    list_replacements();
    forget_replacements(0, replacements_.size());
  }
  /// Replacements not forgotten.
  [[nodiscard]] std::size_t replacement_count() const { return replacements_.size(); }

 private:
  void remove_observer(PointId point, KeyframeId keyframe);
  void put_edge(KeyframeId id, const Edge& edge);
  void put_replacement(KeyframeId id, const Replacement& replacement);
  [[nodiscard]] std::uint32_t& anchored(KeyframeId id);
  void list_replacements();

  /// A culled keyframe whose replacement is known, and how many had been culled with it.
  struct Kept {
    KeyframeId id;
    std::size_t culled;
  };

  GraphSnapshot graph_;
  std::deque<Kept> replacements_;  ///< to be looked at in this order
  std::size_t culled_ = 0;
};

}  // namespace twofold
