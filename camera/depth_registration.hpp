#pragma once

#include <opencv2/core/mat.hpp>

#include "camera/calibration.hpp"
#include "camera/pinhole.hpp"

namespace twofold {

/// Depth images of a camera that stands beside another one, as that other one would have taken them.
///
/// Four readings around a corner of pixels are a piece of surface, unless their depths jump; its two
/// triangles are drawn, so that finer images have no gaps and coarser ones no steps. Readings at a jump are
/// drawn as single pixels. Of several surfaces the nearest is kept. What only the other camera sees has no
/// depth. Immutable after construction; any thread.
class DepthRegistration {
 public:
  /// @param camera      must be valid
  /// @param T_seen_left  turns points of the left camera into those of the one that is to see the depth
  /// @param seen        the latter, without distortion
  /// @param unit        metres per unit of the depth images
  DepthRegistration(const DepthCamera& camera, const SE3& T_seen_left, const PinholeCamera& seen,
                    double unit);

  /// @param depth  CV_16UC1 of the depth camera's size, 0: no reading
  /// @param registered  CV_16UC1 of the size of `seen`; its memory is used again when it fits
  void apply(const cv::Mat& depth, cv::Mat& registered) const;

 private:
  cv::Mat ray_;      // CV_32FC3: of each depth pixel at depth 1, as (u z, v z, z) in the image of `seen`
  cv::Vec3f shift_;  // of the depth camera likewise [units of depth]
  int width_, height_;
};

}  // namespace twofold
