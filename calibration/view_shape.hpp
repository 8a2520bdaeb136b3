#pragma once

#include "calibration/board.hpp"

namespace twofold {

/// How a board is held, as far as one uncalibrated image tells: its pose under a nominal camera (focal length
/// 0.9 times the longer side, no distortion). Angles are good to a few degrees, which is enough to tell
/// people what is missing and to see that all views are alike.
struct ViewShape {
  cv::Vec3d normal{0, 0, -1};  ///< unit normal of the board in the camera's frame, towards the camera
  double size = 0;             ///< longer side of the corners' bounding box as a share of the image's side

  /// Angles by which the board is turned out of the image plane [rad]: about the vertical (> 0: its right
  /// side is farther away) and about the horizontal axis (> 0: its lower side is farther away).
  [[nodiscard]] double yaw() const;
  [[nodiscard]] double pitch() const;
};

/// Nothing when no pose fits (corners in one line).
[[nodiscard]] std::optional<ViewShape> shape_of(const BoardView& view, const Board& board, cv::Size size);

/// Views whose normals stand more than `angle` [rad] from the middle one of all.
[[nodiscard]] int tilted_views(const std::vector<ViewShape>& shapes, double angle);

/// Cells of a grid over the image that hold a corner of any view.
struct Coverage {
  static constexpr int kColumns = 5, kRows = 4;
  std::array<int, kColumns * kRows> corners{};

  void add(const BoardView& view, cv::Size size);
  [[nodiscard]] double share() const;
};

}  // namespace twofold
