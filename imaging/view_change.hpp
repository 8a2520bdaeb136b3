#pragma once

#include <limits>
#include <optional>

#include "camera/pinhole.hpp"
#include "geometry/se3.hpp"

namespace twofold {

/// How differently a point is seen from two places; patches are found again when both are near 1.
struct ViewChange {
  double cosine = 1;  ///< of the angle between the two rays
  double ratio = 1;   ///< distance from the first place over that from the second

  /// @param from_first, from_second  from each place to the point, in axes of the same direction [m]
  static ViewChange between(const Vector3& from_first, const Vector3& from_second) {
    const double first = from_first.norm(), second = from_second.norm();
    return {from_first.dot(from_second) / (first * second), first / second};
  }
};

/// Within what a point counts as seen much as its anchor saw it.
struct ViewLimits {
  double border_px = 0;    ///< the point projects at least so far inside of the image, >= 0
  double min_cosine = -1;  ///< of the angle between both rays, in [-1, 1]
  double max_scale_change =
      std::numeric_limits<double>::infinity();  ///< ratio of both distances, either way,
                                                ///< >= 1
};

/// A view that looks for points as their anchors saw them: whoever searches one, or misses one that should
/// have been found, asks this.
class SimilarView {
 public:
  /// @param T_c_f  pose of the view in the frame f that points are given in
  SimilarView(const PinholeCamera& camera, const SE3& T_c_f, const ViewLimits& limits)
      : camera_(camera), limits_(limits), R_c_f_(T_c_f.rotation()), t_c_f_(T_c_f.translation()) {}

  /// Pixel of a point that the view sees within the limits.
  /// @param x_f, anchor_f  the point, and where its anchor stood [m]
  [[nodiscard]] std::optional<Vector2> find(const Vector3& x_f, const Vector3& anchor_f) const {
    const Vector3 x_c = R_c_f_ * x_f + t_c_f_;
    const auto uv = camera_.find_in_view(x_c, limits_.border_px);
    if (!uv) return std::nullopt;
    const auto [cosine, ratio] = ViewChange::between(x_f - anchor_f, R_c_f_.transpose() * x_c);
    const bool similar = cosine >= limits_.min_cosine && ratio <= limits_.max_scale_change &&
                         ratio * limits_.max_scale_change >= 1;
    return similar ? uv : std::nullopt;
  }

 private:
  PinholeCamera camera_;
  ViewLimits limits_;
  Matrix3 R_c_f_;
  Vector3 t_c_f_;
};

}  // namespace twofold
