#pragma once

#include <cmath>
#include <cstdint>
#include <limits>
#include <vector>

#include "geometry/types.hpp"

namespace twofold {

/// A frame of a clip, its corners in the order of the clip.
struct ClipView {
  std::int64_t t_ns = 0;
  std::vector<Vector2> uv;        ///< [px] as the camera sees them, unrectified; NaN: not found
  std::vector<Vector2> velocity;  ///< of each corner in the image [px/s]

  static inline const Vector2 kUnseen = Vector2::Constant(std::numeric_limits<double>::quiet_NaN());
  [[nodiscard]] bool sees(std::size_t corner) const { return !std::isnan(uv[corner].x()); }
};

/// Some frames of a video, and corners that were followed through all of them.
struct Clip {
  std::vector<ClipView> views;  ///< at least three, in the order of time; the first sees all corners

  [[nodiscard]] std::size_t corners() const { return views.front().uv.size(); }
};

}  // namespace twofold
