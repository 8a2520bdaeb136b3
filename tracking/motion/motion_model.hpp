#pragma once

#include <cstdint>
#include <optional>

#include "tracking/common/placement.hpp"
#include "tracking/motion/options.hpp"

namespace twofold {

/// Where the camera was in the last frame that had a pose, how it moved up to there, and where it is in a
/// later frame had it gone on so.
///
/// `lost` is said of a frame when there were others without a pose between the last one and it.
class MotionModel {
 public:
  /// @param options  must outlive this
  explicit MotionModel(const MotionModelOptions& options) : options_(options) {}

  // The last frame with a pose.
  [[nodiscard]] const Placement& placement() const { return placement_; }
  [[nodiscard]] const SE3& T_c_ref() const { return placement_.T_c_ref; }
  [[nodiscard]] KeyframeId reference() const { return placement_.reference; }  ///< kNoKeyframe: none yet
  /// Its motion (v, omega), left perturbation [m/s, rad/s], if the frame before it had a pose.
  [[nodiscard]] const std::optional<Vector6>& velocity() const { return velocity_; }
  /// Its pose relative to the frame before it, if that one's is relative to the same keyframe.
  [[nodiscard]] const std::optional<SE3>& since_previous() const { return T_this_previous_; }

  /// A frame has a pose: it is now the last one.
  void advance(const Placement& placement, std::int64_t t_ns, bool lost);
  /// The pose of the last frame is relative to another keyframe from now on.
  void refer_to(KeyframeId reference, const SE3& T_old_new);
  /// The last frame was not tracked: its pose was found out later. How the camera moved up to there is left
  /// as it is.
  void place(const Placement& placement, std::int64_t t_ns);

  /// Motion from the last frame to one at `t_ns`: constant velocity, none after a loss. Frames may be missing
  /// between the two; small differences of the interval are taken for jitter of the stamps.
  [[nodiscard]] SE3 predicted_motion(std::int64_t t_ns, bool lost) const;
  /// Pose relative to the reference, likewise.
  [[nodiscard]] SE3 predicted_pose(std::int64_t t_ns, bool lost) const;
  /// Motion from the last frame to one that may be far from it: nothing if nobody knows how fast the camera
  /// was, or where it went since (MotionModelOptions::coast_for).
  [[nodiscard]] std::optional<SE3> coasted(std::int64_t t_ns) const;
  /// The camera's velocity [m/s, rad/s] in a frame that is at T_c_ref, as since the last one; nothing after a
  /// loss.
  [[nodiscard]] std::optional<Vector6> velocity_at(const SE3& T_c_ref, std::int64_t t_ns, bool lost) const;

  /// Whether the camera can have got from the last pose to this one: as fast as it moved then, give or take
  /// what accelerates things that carry cameras. Streets repeat themselves, and what looks alike farther away
  /// is another place; so is, to a car that moved on, the place where it was last. Unless `all_the_time`, it
  /// is taken to have gone on for coast_for at most.
  /// @param T_c_last  pose of the frame relative to the last one
  /// @param all_the_time  it may have gone on for longer than that
  /// @return also true if nobody knows how fast the camera was
  [[nodiscard]] bool reaches(const SE3& T_c_last, std::int64_t t_ns, bool all_the_time) const;

 private:
  [[nodiscard]] double seconds_until(std::int64_t t_ns) const {
    return 1e-9 * static_cast<double>(t_ns - t_ns_);
  }

  const MotionModelOptions& options_;
  Placement placement_;
  std::int64_t t_ns_ = 0;
  std::optional<SE3> T_this_previous_;  ///< the prediction of the next; none after a loss
  double interval_ = 0;                 ///< between the two [s]; 0 after a loss
  std::optional<Vector6> velocity_;
};

}  // namespace twofold
