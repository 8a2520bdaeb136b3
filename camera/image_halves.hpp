#pragma once

#include <algorithm>

#include "camera/pinhole.hpp"

namespace twofold {

/// How many points lie in the left, right, upper and lower half of an image: a pose that hangs on one corner
/// of the image is weak.
class ImageHalves {
 public:
  explicit ImageHalves(const PinholeCamera& camera)
      : centre_(0.5F * static_cast<float>(camera.width), 0.5F * static_cast<float>(camera.height)) {}

  /// @param uv  level-0 pixel
  void add(const Eigen::Vector2f& uv) {
    ++(uv.x() < centre_.x() ? left_ : right_);
    ++(uv.y() < centre_.y() ? upper_ : lower_);
  }
  /// Points in the half that has the fewest.
  [[nodiscard]] int least() const { return std::min({left_, right_, upper_, lower_}); }

 private:
  Eigen::Vector2f centre_;
  int left_ = 0, right_ = 0, upper_ = 0, lower_ = 0;
};

}  // namespace twofold
