#pragma once

#include <atomic>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>

#include "io/frame_source.hpp"

namespace twofold {

struct SourceOptions {
  std::optional<std::filesystem::path>
      calibration;  ///< overrides the one in the recording (docs/calibration.md)
  /// Cameras only: images as they are captured, without calibration or rectification.
  bool raw = false;
  /// Cameras only: when it becomes true, the source ends. Outlives the source.
  const std::atomic<bool>* stop = nullptr;
  bool preload = false;  ///< decode everything into memory before returning
};

/// Opens a source of frames.
///
/// @param text  a path, whose layout is recognised, or scheme:ARGUMENT; either may end in
/// ?key=value&key=value
///
///   kitti:DIR      image_0, image_1 (stereo) or image_0 alone (mono); calib.txt, times.txt, poses.txt if
///   there euroc:DIR      mav0/cam0, mav0/cam1 with data.csv and sensor.yaml; rectified here.  unpaired=drop
///   tum:DIR        RGB-D; associations.txt or rgb.txt + depth.txt, groundtruth.txt if there;
///                  fx fy cx cy depth_scale baseline depth_min depth_max
///   images:DIR     image files in the order of their names, or left/ with right/ or depth/; times.txt or
///   fps=;
///                  fx fy cx cy baseline depth_scale ...
///   video:FILE     fps=, layout=mono|side-by-side; fx fy cx cy baseline
///   v4l2:DEVICE    a camera: size=640x480 fps= format= layout=mono|side-by-side, right=DEVICE or
///                  depth=DEVICE for a second camera paired by time (pairing_ms=), exposure_us= gain= focus=,
///                  buffers= stall_ms= reconnect_ms=; fx fy cx cy baseline instead of a calibration file
///   synthetic:SCENE  rendered (io/synthetic)
///
/// Throws IoError naming the file and what is wrong with it.
[[nodiscard]] std::unique_ptr<FrameSource> open_source(const std::string& text,
                                                       const SourceOptions& options = {});

}  // namespace twofold
