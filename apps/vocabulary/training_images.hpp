#pragma once

#include <functional>
#include <opencv2/core/mat.hpp>
#include <string>
#include <vector>

#include "imaging/binary_descriptor.hpp"
#include "imaging/corner_selection.hpp"
#include "imaging/image_pyramid.hpp"

namespace twofold {

/// The corners of an image as the loop closer would describe them.
class ImageDescriber {
 public:
  /// @param wanted  corners an image, at most
  explicit ImageDescriber(int wanted) : selector_({.wanted = wanted}) {}

  /// @param image  8-bit grey
  [[nodiscard]] std::vector<DescribedCorner> describe(const cv::Mat& image);

 private:
  CornerSelector selector_;
  CornerDescriber describer_;
  ImagePyramid pyramid_;
};

/// The image itself, or a smaller one whose longer side has 1024 pixels.
[[nodiscard]] cv::Mat reduced(const cv::Mat& image);

/// Calls `use` with each image of an input, 8-bit grey.
/// @param input  an image file, a folder of images, or a source of frames
/// @param every  takes each Nth image of folders and sources
/// Throws IoError.
void for_each_image(const std::string& input, int every, const std::function<void(const cv::Mat&)>& use);

}  // namespace twofold
