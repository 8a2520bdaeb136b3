#pragma once

#include <opencv2/core/mat.hpp>

#include "io/bags/ros_messages.hpp"

namespace twofold {

/// [m] a unit of depth images of 16 bits, where nobody says otherwise (REP 118).
inline constexpr double kRosDepthUnit = 0.001;

// Copies: nothing of the message is kept. All throw MalformedBytes naming the encoding that is not known, or
// what is wrong with the pixels.

/// CV_8UC1 of mono8, 8UC1, rgb8, bgr8, rgba8, bgra8, bayer_*8 and 8UC3; CV_16UC1 of mono16 and 16UC1.
[[nodiscard]] cv::Mat grey_image(const ImageMessage& image);
/// Of a JPEG, PNG, ... file, of 8 or 16 bits as that is; rows are the file's, whatever EXIF says.
[[nodiscard]] cv::Mat grey_image(const CompressedImageMessage& image);
/// CV_8UC3 (blue, green, red) of rgb8, bgr8, rgba8, bgra8, bayer_*8 and 8UC3; empty of the others.
[[nodiscard]] cv::Mat colour_image(const ImageMessage& image);
/// Of a file with three channels or four, in 8 bits each; empty of others.
[[nodiscard]] cv::Mat colour_image(const CompressedImageMessage& image);
/// CV_16UC1, 0 where there is none: 16UC1 and mono16 as they are, 32FC1 [m] in units of `unit` [m].
[[nodiscard]] cv::Mat depth_image(const ImageMessage& image, double unit = kRosDepthUnit);
/// Of a PNG file with 16 bits, as it is, with or without the header of ROS's compressedDepth.
[[nodiscard]] cv::Mat depth_image(const CompressedImageMessage& image);

}  // namespace twofold
