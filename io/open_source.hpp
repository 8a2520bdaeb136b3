#pragma once

#include <filesystem>
#include <memory>
#include <optional>
#include <string>

#include "io/frame_source.hpp"

namespace twofold {

struct SourceOptions {
  std::optional<std::filesystem::path>
      calibration;       ///< overrides the one in the recording (docs/calibration.md)
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
///   synthetic:SCENE  rendered (io/synthetic)
///
/// Throws IoError naming the file and what is wrong with it.
[[nodiscard]] std::unique_ptr<FrameSource> open_source(const std::string& text,
                                                       const SourceOptions& options = {});

}  // namespace twofold
