#pragma once

#include <memory>
#include <opencv2/core/mat.hpp>
#include <stdexcept>

#include "twofold/types.hpp"

namespace twofold {

/// The pixels of `image` where they are: CV_8UC1, CV_8UC3 (blue, green, red), CV_16UC1 (depth) or CV_32FC1
/// (depth in metres). An empty image gives an empty view. Throws std::invalid_argument for other types.
[[nodiscard]] inline ImageView view(const cv::Mat& image) {
  if (image.empty()) return {};
  ImageView view{image.data, image.cols, image.rows, static_cast<std::ptrdiff_t>(image.step[0])};
  switch (image.type()) {
    case CV_8UC1:
      view.format = ImageFormat::kGrey8;
      return view;
    case CV_8UC3:
      view.format = ImageFormat::kBgr8;
      return view;
    case CV_16UC1:
      view.format = ImageFormat::kDepth16;
      return view;
    case CV_32FC1:
      view.format = ImageFormat::kDepth32F;
      return view;
    default:
      throw std::invalid_argument("an image must be CV_8UC1, CV_8UC3, CV_16UC1 or CV_32FC1");
  }
}

/// A frame that shares the images' pixels and keeps them. Do not overwrite them afterwards: cv::VideoCapture
/// reuses the image it is given, so pass image.clone().
[[nodiscard]] inline FrameView stereo_frame(std::int64_t t_ns, const cv::Mat& left, const cv::Mat& right) {
  auto owner = std::make_shared<const std::array<cv::Mat, 2>>(std::array<cv::Mat, 2>{left, right});
  return {t_ns, view(left), view(right), {}, std::move(owner)};
}
/// The same of a colour or grey image and its registered depth, CV_16UC1 or CV_32FC1.
[[nodiscard]] inline FrameView rgbd_frame(std::int64_t t_ns, const cv::Mat& image, const cv::Mat& depth) {
  auto owner = std::make_shared<const std::array<cv::Mat, 2>>(std::array<cv::Mat, 2>{image, depth});
  return {t_ns, view(image), {}, view(depth), std::move(owner)};
}
/// The same of the image of one camera.
[[nodiscard]] inline FrameView mono_frame(std::int64_t t_ns, const cv::Mat& image) {
  return {t_ns, view(image), {}, {}, std::make_shared<const cv::Mat>(image)};
}

}  // namespace twofold
