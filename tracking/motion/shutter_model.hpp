#pragma once

#include <cstddef>
#include <optional>

#include "camera/readout_estimator.hpp"
#include "camera/rig.hpp"
#include "camera/rolling_shutter.hpp"
#include "tracking/common/frame_step.hpp"
#include "tracking/motion/motion_model.hpp"
#include "tracking/search/local_map_search.hpp"

namespace twofold {

/// Rows that are read one after the other: how the camera moves within a frame, how long its readout takes,
/// and what of that stays uncertain. A readout that the calibration leaves open is learnt.
///
/// No allocation after construction.
class ShutterModel {
 public:
  /// @param motion      of the camera up to the frame that is asked for; must outlive this
  /// @param max_points  found in a frame at most
  ShutterModel(const Rig& rig, const MotionModel& motion, std::size_t max_points,
               const ShutterOptions& options = {});

  /// The shutter of a frame whose pose is T_c_ref.
  [[nodiscard]] RollingShutter at(const SE3& T_c_ref, const FrameStep& step) const;

  /// What the shutter adds to the covariance of the frame's pose: the readout is known with an error, if at
  /// all, and the motion within a frame is taken to be that since the frame before, which is wrong by half of
  /// what the motion changed by, or by all of it where the frame before knew none. Zero when the reference
  /// has changed.
  /// @param by_rows  RegionSums::by_rows of the measurements that `information` is of
  [[nodiscard]] Matrix6 covariance(const Matrix6& information, const Matrix6& by_rows,
                                   const FrameStep& step) const;

  /// From what was found in a frame and the ones before, whether it fitted the map or not. To be called once
  /// the motion model has the frame.
  void learn(const FrameStep& step, const SearchOutcome& found, const LocalMap& local_map);

  /// The readout as far as it is known by now; once it is significant, later frames are tracked with it.
  /// Nothing if the rig has it.
  [[nodiscard]] std::optional<ReadoutEstimate> readout() const {
    return readout_ ? std::optional(readout_->estimate()) : std::nullopt;
  }

 private:
  [[nodiscard]] std::optional<Vector6> velocity(const SE3& T_c_ref, const FrameStep& step) const;
  [[nodiscard]] double readout_sigma() const;

  Rig rig_;  ///< with the readout, once that is found
  const MotionModel& motion_;
  ShutterOptions options_;
  std::optional<ReadoutEstimator> readout_;  ///< if the calibration leaves it open
};

}  // namespace twofold
