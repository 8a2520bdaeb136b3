#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "twofold/types.hpp"

namespace twofold {

struct SourceSettings {
  std::filesystem::path calibration = {};  ///< instead of the recording's own; empty: its own
  bool preload = false;                    ///< decode everything into memory before the constructor returns
  bool left_only = false;                  ///< the left camera alone, as Sensor::kMono
};

/// Frames of a recording, a video, a rendered scene or a camera, rectified.
///
/// Named as on the command line (docs/sources.md): a path, or kitti:DIR, euroc:DIR, tum:DIR, 7scenes:DIR,
/// replica:DIR, scannet:DIR, images:DIR, video:FILE, mcap:FILE, bag:FILE, v4l2:DEVICE, synthetic:SCENE, with
/// ?key=value&key=value.
///
/// Threads: every function may be called by any thread; those that ask for frames take turns. Moving a Source
/// must not overlap any other call on it.
class TWOFOLD_API Source {
 public:
  /// Throws std::runtime_error naming the file and what is wrong with it.
  explicit Source(const std::string& name, const SourceSettings& settings = {});
  ~Source();
  Source(Source&&) noexcept;
  Source& operator=(Source&&) noexcept;

  [[nodiscard]] const CameraRig& rig() const;
  /// Rotation from the calibrated left camera, as its lens took the images, to the rectified one that poses
  /// are of, by the calibration that this source uses: p_rectified = T_rectified_raw * p_raw; the identity
  /// where it delivers the images as they came. Of several calibrations that one could read, this is the
  /// right one for the poses of this source (FrameRectifier::T_rectified_raw has the two lines to the pose of
  /// the body).
  [[nodiscard]] Pose T_rectified_raw() const;
  /// Frames in all, where that is known beforehand.
  [[nodiscard]] std::optional<std::int64_t> frame_count() const;
  /// Frames come when they are taken, not when they are asked for; their times are of CLOCK_MONOTONIC, as
  /// SlamOptions::live needs them.
  [[nodiscard]] bool is_live() const;
  /// Of the rig's camera, in the order of time; empty when there is none.
  [[nodiscard]] const std::vector<StampedPose>& ground_truth() const;

  /// The next frame, with an owner: it may be pushed and kept. False at the end. Throws std::runtime_error
  /// when the input breaks.
  bool next(FrameView& frame);
  /// A frame that next gave, with its left image in colour (kBgr8) if the recording has it, else as it is:
  /// what a SurfaceModel takes its colours from; Slam takes the frame itself. Decoded when it is asked for,
  /// as for keyframes, so that others cost nothing. Cameras have none. Throws as next.
  [[nodiscard]] FrameView in_colour(const FrameView& frame) const;
  /// A camera ends; for recordings, the next call of next() is the last.
  void stop();

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace twofold
