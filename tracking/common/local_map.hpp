#pragma once

#include <cstdint>
#include <span>
#include <utility>
#include <vector>

#include "graph/neighbourhood.hpp"
#include "graph/snapshot.hpp"
#include "tracking/common/immature_points.hpp"

namespace twofold {

/// A point worth searching for in the next frames.
struct TrackedPoint {
  PointId id = kNoPoint;                        ///< kNoPoint: an immature point, which the map does not know
  int immature = -1;                            ///< position in ImmaturePoints, -1 for map points
  int anchor = 0;                               ///< position in LocalMap::anchors
  const PointAppearance* appearance = nullptr;  ///< lives as long as the snapshot, or the immature point
  Vector3 psi{0, 0, 1};
  Vector3 x_ref{0, 0, 1};  ///< in the reference keyframe's frame [m]
  double ray_sigma = 0;    ///< ImmaturePoint::ray_sigma
};

struct AnchorPose {
  KeyframeId id = kNoKeyframe;
  SE3 T_ref_a;
};

/// The candidate set for top-down tracking  (thesis 6.2.5): points seen from N1 of the reference keyframe
/// (eq. 6.5), and the immature points. Pointers are valid until map, reference or immature points change.
class LocalMap {
 public:
  /// Room for the points around a reference keyframe and its neighbours: some ten times as many as a frame
  /// searches.
  static constexpr std::size_t kMaxPoints = 3000;

  explicit LocalMap(std::size_t capacity = kMaxPoints);

  /// Collects the points around `reference`, a keyframe of the graph or a pending one, unless nothing of that
  /// has changed since the last time.
  void update(const GraphSnapshot& graph, KeyframeId reference, const ImmaturePoints& immature,
              int max_neighbours);

  [[nodiscard]] std::span<const TrackedPoint> points() const { return points_; }
  [[nodiscard]] const SE3& T_ref_a(const TrackedPoint& point) const {
    return anchors_[static_cast<std::size_t>(point.anchor)].T_ref_a;
  }
  /// Where the point was seen first.
  [[nodiscard]] KeyframeId anchor(const TrackedPoint& point) const {
    return anchors_[static_cast<std::size_t>(point.anchor)].id;
  }
  /// Positions [first, last) of the points that the reference keyframe itself sees.
  [[nodiscard]] std::pair<std::size_t, std::size_t> reference_range() const { return reference_range_; }
  /// Of the map that the points were collected from.
  [[nodiscard]] std::uint64_t version() const { return origin_.version; }
  /// N1 of the reference, which comes first.
  [[nodiscard]] std::span<const KeyframeId> neighbours() const { return neighbours_; }

 private:
  static constexpr std::size_t kTable = 1U << 14;  ///< slots of the set of points met; a power of two
  static constexpr std::size_t kMaxMet = kTable / 2;

  /// What the points were collected from.
  struct Origin {
    std::uint64_t version = 0;   ///< of the map
    std::uint64_t revision = 0;  ///< of the immature points
    KeyframeId reference = kNoKeyframe;
    friend bool operator==(const Origin&, const Origin&) = default;
  };

  void rebuild(const GraphSnapshot& graph, const ImmaturePoints& immature, int max_neighbours);
  bool first_sight(PointId id);
  int anchor_position(const GraphSnapshot& graph, KeyframeId id, const ImmaturePoints& immature);
  void add_neighbour(const GraphSnapshot& graph, KeyframeId id, const ImmaturePoints& immature);

  std::vector<TrackedPoint> points_;
  std::vector<AnchorPose> anchors_;
  std::vector<KeyframeId> neighbours_;
  std::vector<std::uint64_t> met_;  // open addressing: generation in the high half, point in the low half
  std::uint32_t generation_ = 0;
  std::size_t met_count_ = 0;  ///< in this generation
  Origin origin_;
  std::pair<std::size_t, std::size_t> reference_range_{0, 0};
};

/// T_k_w of a keyframe in the graph, or of a pending one through the keyframes it was proposed relative to.
[[nodiscard]] SE3 pose_in_world(const GraphSnapshot& graph, const ImmaturePoints& immature, KeyframeId k);
/// Map part of a keyframe in the graph or pending.
[[nodiscard]] KeyframeId part_of(const GraphSnapshot& graph, const ImmaturePoints& immature, KeyframeId k);
/// T_k_ref of two keyframes of one part, each in the graph or pending.
[[nodiscard]] SE3 pose_relative_to(const GraphSnapshot& graph, const ImmaturePoints& immature, KeyframeId k,
                                   KeyframeId ref);

}  // namespace twofold
