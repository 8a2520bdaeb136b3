#pragma once

#include <atomic>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>

#include "io/sources/frame_source.hpp"

namespace twofold {

/// Choices, none of which can be invalid by itself; what does not go together with a source, open_source
/// says.
struct SourceOptions {
  /// Overrides the one in the recording (docs/calibration.md).
  std::optional<std::filesystem::path> calibration;
  /// Cameras only: images as they are captured, without calibration or rectification.
  bool raw = false;
  /// Cameras only: when it becomes true, the source ends. Outlives the source.
  const std::atomic<bool>* stop = nullptr;
  /// Where neither a file nor the recording has a calibration, some pinhole is supposed: images come as they
  /// are, and rig() means their size only.
  bool suppose_camera = false;
  /// One camera, with the left images as a pair's rectification turns them, if the pair is known: right and
  /// depth images are left out. Folders and side-by-side videos need not have them, nor a calibration of
  /// them.
  bool left_only = false;
  bool preload = false;  ///< decode everything into memory before returning
};

/// Opens a source of frames.
///
/// @param text  a path, whose layout is recognised, or scheme:ARGUMENT; either may end in
/// ?key=value&key=value
///              (docs/sources.md has the keys)
///
///   kitti:DIR        image_0, image_1 (stereo) or image_0 alone (mono), or 2, 3 in colour; calib.txt,
///   times.txt,
///                    poses.txt or ../../poses/DIR.txt
///   euroc:DIR        mav0/cam0, mav0/cam1 with data.csv and sensor.yaml; rectified here
///   tum:DIR          RGB-D; associations.txt, rgb.txt and depth.txt, or color.txt and aligned_depth.txt;
///                    groundtruth.txt if there
///   7scenes:DIR      frame-000000.color.png, .depth.png, .pose.txt
///   replica:DIR      results/frame000000.jpg, results/depth000000.png, traj.txt
///   scannet:DIR      color/0.jpg, depth/0.png, pose/0.txt, intrinsic/
///   images:DIR       image files in the order of their names, or left/ with right/ or depth/; times.txt
///   video:FILE       one image, or two side by side
///   mcap:FILE        a recording of ROS 1 or 2; bag:FILE one of ROS 1
///   v4l2:DEVICE      a camera, or two paired by time
///   synthetic:SCENE  rendered (synthetic/)
///
/// Throws IoError naming the file and what is wrong with it.
[[nodiscard]] std::unique_ptr<FrameSource> open_source(const std::string& text,
                                                       const SourceOptions& options = {});

class PlaybackSource;

/// Of these only those that are folders of image files: kitti, euroc, tum, 7scenes, replica, scannet, images;
/// their left camera. Null for all others, of which nothing is opened.
[[nodiscard]] std::unique_ptr<PlaybackSource> open_recording(
    const std::string& text, const std::optional<std::filesystem::path>& calibration);

}  // namespace twofold
