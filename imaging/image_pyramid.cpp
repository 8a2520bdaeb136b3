#include "imaging/image_pyramid.hpp"

#include <opencv2/imgproc.hpp>

namespace twofold {

void ImagePyramid::build(const cv::Mat& image) {
  image.copyTo(levels_[0]);
  for (std::size_t l = 1; l < kLevels; ++l) {
    const cv::Size size(levels_[l - 1].cols / 2, levels_[l - 1].rows / 2);
    // An odd last row or column has no partner and is left out.
    const cv::Mat even = levels_[l - 1](cv::Rect(0, 0, 2 * size.width, 2 * size.height));
    cv::resize(even, levels_[l], size, 0, 0, cv::INTER_AREA);
  }
}

void ImagePyramid::copy_from(const ImagePyramid& other) {
  for (std::size_t l = 0; l < kLevels; ++l) {
    if (other.levels_[l].empty()) {
      levels_[l].release();
    } else {
      other.levels_[l].copyTo(levels_[l]);
    }
  }
}

void FrameImages::copy_from(const FrameImages& other) {
  left.copy_from(other.left);
  right.copy_from(other.right);
  if (other.depth.empty()) {
    depth.release();
  } else {
    other.depth.copyTo(depth);
  }
}

}  // namespace twofold
