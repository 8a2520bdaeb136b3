#pragma once

#include <array>
#include <opencv2/core/mat.hpp>
#include <span>

namespace twofold {

/// Grey images CV_8UC1, level 0 the original, each next one half the size by 2x2 averaging.
///
/// Pixel p of level l lies at (p + 0.5) 2^l - 0.5 in level 0  (PinholeCamera::at_level uses the same
/// convention). Buffers are kept between builds: the second build of the same size allocates nothing.
class ImagePyramid {
 public:
  static constexpr int kLevels = 5;

  /// Refills all levels from `image` (CV_8UC1, copied).
  /// @param dead  pixels that show nothing, not on the image's edge: their neighbours take their place
  void build(const cv::Mat& image, std::span<const cv::Point> dead = {});
  /// Deep copy into existing buffers of the same size, if there are any.
  void copy_from(const ImagePyramid& other);

  [[nodiscard]] bool empty() const { return levels_[0].empty(); }
  [[nodiscard]] const cv::Mat& level(int l) const { return levels_[static_cast<std::size_t>(l)]; }

 private:
  std::array<cv::Mat, kLevels> levels_;
};

/// What is kept of one frame while it is tracked, mapped and described.
/// right is empty except for stereo; depth (CV_16UC1, see Frame) is empty except for RGB-D.
struct FrameImages {
  ImagePyramid left;
  ImagePyramid right;
  cv::Mat depth;

  void copy_from(const FrameImages& other);
};

/// Of the whole image [grey].
[[nodiscard]] double mean_brightness(const ImagePyramid& pyramid);

}  // namespace twofold
