#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "camera/rig.hpp"
#include "camera/rolling_shutter.hpp"
#include "graph/keyframe.hpp"
#include "graph/snapshot.hpp"
#include "imaging/point_appearance.hpp"

namespace twofold {

/// A point the tracker started itself and that no snapshot holds yet  (thesis 6.3: such points are used for
/// tracking at once, and join the map only when a later keyframe finds them again).
struct ImmaturePoint {
  KeyframeId anchor = kNoKeyframe;
  KeyframeId usable_since = kNoKeyframe;  ///< the newest keyframe when its depth was known: the anchor, where
                                          ///< that is measured, or a later one
  Vector3 psi{0, 0, 1};
  /// Standard deviation of its inverse depth where nobody knows that yet: such a point is a ray, which only
  /// carries the camera's rotation, and is no point of the map. 0: the depth is known [1/m].
  double ray_sigma = 0;
  std::uint32_t seed = 0;  ///< of a ray, the number of the depth seed that lent it (DepthSeeds)
  Observation anchor_observation;
  PointAppearance appearance;
  PointId id = kNoPoint;                 ///< given when it is proposed to the map
  KeyframeId proposed_in = kNoKeyframe;  ///< the keyframe that found it again
  std::uint8_t failures = 0;             ///< searches in a row without a match
  std::uint8_t agreed = 0;               ///< frames in a row in which it was where it should be
  std::uint8_t moved = 0;                ///< times in a row that it was found where it should not be

  [[nodiscard]] bool is_ray() const { return ray_sigma > 0; }
};

/// A point that was measured where the camera was when its row was exposed, psi and observation, as its
/// anchor has it at mid-exposure. Left as it is if it would be behind the camera there.
/// @param shutter  of the anchor
void move_to_mid_exposure(const Rig& rig, const RollingShutter& shutter, ImmaturePoint& point);

/// What becomes of points that no snapshot holds yet.
struct ImmaturePointOptions {
  int max_failures = 4;  ///< not found in so many searches in a row, >= 1: given up
  int max_age = 3;       ///< keyframes since it was usable, after which a point is given up, >= 0
  /// The same of one camera, >= 0: driving, each frame is a keyframe, and with the points that its map does
  /// not get in time goes what holds its scale.
  int max_age_of_one_camera = 5;
  /// While young points are mistrusted: frames in a row in which a point must agree to be confirmed,
  /// in [0, 255].
  int trusted_after = 3;
  int moving_after = 2;  ///< times in a row that a point is found elsewhere, >= 1: it is said to move

  /// Empty when valid; otherwise names the field, the rule and the value.
  [[nodiscard]] std::string invalid_reason() const;
};

/// A keyframe that was proposed but is not in the snapshot yet.
struct PendingKeyframe {
  KeyframeId id = kNoKeyframe;
  KeyframeId reference = kNoKeyframe;  ///< kNoKeyframe: first of the map
  SE3 T_k_ref;
};

/// The immature points, and the keyframes that were proposed, until the map has them. Never grows beyond its
/// capacity.
class ImmaturePoints {
 public:
  ImmaturePoints(std::size_t point_capacity, std::size_t keyframe_capacity) {
    points_.reserve(point_capacity);
    pending_.reserve(keyframe_capacity);
  }

  [[nodiscard]] std::vector<ImmaturePoint>& points() { return points_; }
  [[nodiscard]] const std::vector<ImmaturePoint>& points() const { return points_; }
  /// The point that TrackedPoint::immature says; null: the map has it.
  [[nodiscard]] ImmaturePoint* at(int position) {
    return position < 0 ? nullptr : &points_[static_cast<std::size_t>(position)];
  }
  [[nodiscard]] const std::vector<PendingKeyframe>& pending() const { return pending_; }
  [[nodiscard]] bool room_for_keyframe() const { return pending_.size() < pending_.capacity(); }
  [[nodiscard]] const PendingKeyframe* find_pending(KeyframeId id) const;

  /// Grows whenever points or proposals come or go: what was derived from them is then out of date.
  [[nodiscard]] std::uint64_t revision() const { return revision_; }

  void add_pending(const PendingKeyframe& keyframe);
  /// False when full.
  bool add(const ImmaturePoint& point);
  /// A point has changed in its place.
  void changed() { ++revision_; }
  /// Forgets all points.
  void clear_points();
  /// Forgets what the map has.
  void forget_mapped(const GraphSnapshot& graph);
  /// Forgets points that failed too often, or that have been usable for more than `max_age` keyframes, none
  /// of which confirmed them.
  void drop_stale(KeyframeId newest, int max_failures, int max_age);

 private:
  std::vector<ImmaturePoint> points_;
  std::vector<PendingKeyframe> pending_;
  std::uint64_t revision_ = 0;
};

}  // namespace twofold
