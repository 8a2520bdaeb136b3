#pragma once

#include <filesystem>

#include "estimation/window_problem.hpp"

namespace twofold {

/// Reads a bundle adjustment problem as a window of free poses without pose-pose constraints. Intrinsics are
/// held; measurements are freed from distortion first. Points are anchored in the first camera that has them
/// in front; observations behind their camera, and points with fewer than two usable ones, are dropped.
///
/// Layouts, told apart by what the path holds:
///   - a file "in the large" (BAL): cameras points observations; camera point x y; then nine numbers a camera
///     (rotation vector, translation, f, k1, k2; the camera looks along -z), three a point, one a line.
///     Errors of cameras with different f are weighted so that they count in each camera's own pixels;
///   - the libmv text layout: cameras points observations; marker space, f cx cy k1 k2 k3 p1 p2; camera point
///     u v; a line a camera (rotation vector, translation; +z); a line a point;
///   - a folder of stereo tracks: VO_calibration.txt, VO_camera_poses_large.txt, VO_stereo_factors_large.txt.
///
/// Throws std::runtime_error that names file, line and what is wrong.
[[nodiscard]] WindowProblem read_bundle(const std::filesystem::path& path);

}  // namespace twofold
