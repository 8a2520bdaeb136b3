#pragma once

#include <array>
#include <cstdint>
#include <optional>

#include "camera/pinhole.hpp"
#include "geometry/se3.hpp"

namespace twofold {

/// How far the camera's motion over some frames has moved, in the image, what stands at a pixel, whatever its
/// depth within bounds. Remembers the newest frames' motion. No allocation.
class ImageMotion {
 public:
  static constexpr std::int64_t kRemembered = 64;  ///< frames

  explicit ImageMotion(const PinholeCamera& camera) : camera_(camera) {}

  /// A frame whose motion since the one before is known.
  void advance(const SE3& T_now_before);
  /// A frame whose motion is not known, or not to be trusted: there is no way from earlier frames to it.
  void restart();
  /// Of the scene [1/m]: 0 < least <= most.
  void set_inverse_depths(double least, double most);

  /// Number of the newest frame.
  [[nodiscard]] std::int64_t frame() const { return frame_; }
  /// The shortest of the displacements that a point seen at `uv` in frame `then` may have had since, over all
  /// depths within bounds [px]: (0, 0) if it may be behind the camera by now; nothing if the way since then
  /// is not known.
  [[nodiscard]] std::optional<Vector2> least_since(std::int64_t then, const Vector2& uv);

 private:
  PinholeCamera camera_;
  std::array<SE3, kRemembered> T_frame_first_;  ///< of frame f at f % kRemembered
  std::int64_t frame_ = 0, first_ = 0;
  double least_ = 0, most_ = 0;
  std::int64_t then_ = -1;  ///< what T_now_then_ is of
  SE3 T_now_then_;
};

}  // namespace twofold
