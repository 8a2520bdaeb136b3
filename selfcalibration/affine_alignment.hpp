#pragma once

#include <Eigen/Core>
#include <opencv2/core/mat.hpp>

#include "imaging/point_appearance.hpp"

namespace twofold {

/// Where and how a patch appears in another image: patch pixel x, relative to the corner, at A x + centre.
struct AffineMatch {
  Eigen::Matrix2f A = Eigen::Matrix2f::Identity();
  Eigen::Vector2f centre{0, 0};  ///< [px of the patch's level]
};

/// Aligns a patch with an image of its level under an affine warp, gain and offset (Lucas-Kanade with the
/// parameters of Shi and Tomasi, CVPR 1994, Gauss-Newton), beginning with `match`.
///
/// A patch that only shifts is placed wrongly, always to the same side, when the camera has turned or come
/// nearer since it was cut; over many frames that bends what is estimated from its places.
///
/// @return  false when it does not converge, leaves the image, or does not look alike
[[nodiscard]] bool align_affine(const PointAppearance& appearance, const cv::Mat& image, AffineMatch& match);

}  // namespace twofold
