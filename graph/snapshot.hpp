#pragma once

#include <cstdint>
#include <optional>

#include "graph/keyframe.hpp"
#include "graph/map_point.hpp"
#include "graph/persistent_vector.hpp"

namespace twofold {

/// A change of many poses at once, as the mapper announces it to those who use poses.
struct MapChange {
  enum class Kind : std::uint8_t { kLoopClosure, kPoseGraph, kPartsJoined };
  std::uint64_t version = 0;  ///< first version that has it; 0: there was none yet
  Kind kind = Kind::kLoopClosure;
};

/// One immutable version of the SLAM graph. Copying it is O(1); versions share what did not change.
class GraphSnapshot {
 public:
  GraphSnapshot() = default;

  [[nodiscard]] std::uint64_t version() const { return version_; }
  [[nodiscard]] std::size_t keyframe_count() const { return keyframes_.size(); }
  [[nodiscard]] std::size_t point_count() const { return points_.size(); }
  [[nodiscard]] bool contains(KeyframeId id) const { return index(id) < keyframes_.size(); }
  [[nodiscard]] bool contains(PointId id) const { return index(id) < points_.size(); }
  [[nodiscard]] const Keyframe& keyframe(KeyframeId id) const { return keyframes_[index(id)]; }
  [[nodiscard]] const MapPoint& point(PointId id) const { return points_[index(id)]; }
  /// V_ref, the current centre of interest  (6.2.2); kNoKeyframe in an empty graph.
  [[nodiscard]] KeyframeId reference() const { return reference_; }

  [[nodiscard]] const MapChange& last_change() const { return last_change_; }

  /// Replacement of a culled keyframe; it may be culled by now.
  [[nodiscard]] const Replacement& replacement(KeyframeId id) const { return replacements_[index(id)]; }
  struct LiveReplacement {
    KeyframeId id = kNoKeyframe;
    SE3 T_this_live;
  };
  /// The keyframe that stands for `id`: itself, or, for a culled one, the first that is left along its
  /// replacements. None if `id` was culled so long ago that its replacement is forgotten.
  [[nodiscard]] std::optional<LiveReplacement> live_replacement(KeyframeId id) const;

  /// Pose of a keyframe, also of a culled one through its replacements; those must not be forgotten.
  [[nodiscard]] SE3 T_k_w(KeyframeId id) const;
  /// Map part of a keyframe, also of a culled one: its replacements'. kNoKeyframe if those are forgotten.
  [[nodiscard]] KeyframeId part(KeyframeId id) const;
  /// Position of a point that was not culled, in the world frame [m].
  [[nodiscard]] Vector3 position(PointId id) const;

 private:
  friend class GraphWriter;

  std::uint64_t version_ = 0;
  KeyframeId reference_ = kNoKeyframe;
  MapChange last_change_;
  // Small chunks: a write copies one.
  PersistentVector<Keyframe, 5, 3> keyframes_;
  PersistentVector<MapPoint, 5, 3> points_;
  PersistentVector<Replacement, 5, 3> replacements_;  ///< of culled keyframes; up to the newest of them
};

/// Binary search in keyframe.observations; nullptr if the keyframe does not observe the point.
[[nodiscard]] const Observation* find_observation(const Keyframe& keyframe, PointId point);
/// Binary search in keyframe.edges; nullptr if there is no such edge.
[[nodiscard]] const Edge* find_edge(const Keyframe& keyframe, KeyframeId other);

/// T_to_from along edge (from, to): the stored constraint if it is marginalised, else from the absolute
/// poses.
[[nodiscard]] SE3 relative_pose(const GraphSnapshot& graph, KeyframeId from, const Edge& edge);

}  // namespace twofold
