#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <vector>

#include "camera/measurement.hpp"
#include "geometry/se3.hpp"
#include "graph/ids.hpp"

namespace twofold {

/// That keyframe V_i sees point y_k, and its measurement z_ik  (thesis 6.2.2).
struct Observation {
  PointId point = kNoPoint;
  StereoPixelF pixel{0, 0, 0};
  std::uint8_t level = 0;  ///< pyramid level it was measured on: standard deviation grows with 2^level
};

/// Relative edge E_ij of the SLAM graph, kept by both its keyframes  (6.2.2).
struct Edge {
  KeyframeId other = kNoKeyframe;
  int weight = 0;             ///< w_ij: points visible in both keyframes
  bool marginalised = false;  ///< else the relative pose is that of the two absolute poses
  SE3 T_other_this;           ///< constraint, of use only when marginalised [m]
};

using ObservationList = std::vector<Observation>;  ///< ascending by point
using EdgeList = std::vector<Edge>;                ///< ascending by other keyframe

/// The lists of keyframes that have nothing: one of each for all.
[[nodiscard]] inline std::shared_ptr<const ObservationList> no_observations() {
  static const auto kNone = std::make_shared<const ObservationList>();
  return kNone;
}
[[nodiscard]] inline std::shared_ptr<const EdgeList> no_edges() {
  static const auto kNone = std::make_shared<const EdgeList>();
  return kNone;
}

/// Vertex V_i of the SLAM graph. A value: lists are shared between versions and replaced, never changed in
/// place.
struct Keyframe {
  KeyframeId id = kNoKeyframe;
  /// Names the map part: its first keyframe. T_k_w refers to the part's world frame; the world frames of two
  /// parts have no known relation.
  KeyframeId part{0};
  std::int64_t frame_index = 0;
  std::int64_t t_ns = 0;
  std::uint32_t anchored = 0;  ///< points whose anchor it is; counted by GraphWriter
  SE3 T_k_w;  ///< absolute pose: accurate relative to its neighbours, less so to distant keyframes
  double median_depth = 0;  ///< of the points it sees [m]
  std::shared_ptr<const ObservationList> observations = no_observations();
  std::shared_ptr<const EdgeList> edges = no_edges();

  /// The fields of a culled keyframe are those of Keyframe{}. For as long as its Replacement is kept,
  /// GraphSnapshot still knows its pose (T_k_w) and its part.
  [[nodiscard]] bool culled() const { return id == kNoKeyframe; }
};

/// A pose in 56 bytes; SE3 takes more, for alignment.
class PackedPose {
 public:
  PackedPose() : PackedPose(SE3()) {}
  explicit PackedPose(const SE3& T) {
    Eigen::Map<Eigen::Vector4d>(values_.data()) = T.so3().quaternion().coeffs();
    Eigen::Map<Vector3>(values_.data() + 4) = T.translation();
  }
  [[nodiscard]] SE3 unpacked() const {
    const Eigen::Quaterniond q(Eigen::Map<const Eigen::Vector4d>(values_.data()).eval());
    return {SO3(q), Eigen::Map<const Vector3>(values_.data() + 4)};
  }
  friend bool operator==(const PackedPose&, const PackedPose&) = default;

 private:
  std::array<double, 7> values_;  ///< quaternion (x, y, z, w), translation
};

/// The keyframe that stands for a culled one, with the culled one's pose relative to it. It may be culled
/// later itself. Kept for as long as somebody may ask (GraphWriter::forget_replacements).
struct Replacement {
  KeyframeId id = kNoKeyframe;  ///< kNoKeyframe: forgotten
  std::uint32_t anchored = 0;   ///< points that are still anchored in the culled keyframe
  PackedPose T_this_replacement;
};

}  // namespace twofold
