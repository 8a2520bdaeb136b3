#pragma once

#include <memory>
#include <opencv2/core/mat.hpp>
#include <string>

#include "camera/frame.hpp"
#include "twofold/types.hpp"

namespace twofold {

/// Empty when the view describes an image, of depth or not, whose pixels can be read; else one sentence that
/// says what is wrong.
/// @param name  of the image, for the sentence
[[nodiscard]] std::string pixels_refusal(const char* name, const ImageView& view, bool depth);

/// Empty when both images of a pair are of one format; else one sentence that says of which they are.
[[nodiscard]] std::string pair_refusal(const FrameView& view);

/// The pixels of a view of grey, of colour or of kDepth16 that is not refused, CV_8UC1 or CV_16UC1; an empty
/// image for a view without data. With an owner, grey images and depth stay where they are, and the image
/// keeps the owner; else they are copied. Colour is turned to grey.
[[nodiscard]] cv::Mat pixels_of(const ImageView& view, const std::shared_ptr<const void>& owner);

/// Likewise of a depth image, CV_16UC1; one in metres is turned to units, in a copy.
/// @param unit  Rig::depth_unit [m]
[[nodiscard]] cv::Mat depth_pixels_of(const ImageView& view, const std::shared_ptr<const void>& owner,
                                      double unit);

/// A copy of the pixels of a colour image, CV_8UC3 (blue, green, red).
[[nodiscard]] cv::Mat bgr_pixels_of(const ImageView& view);

/// The other way round: a frame's images, which the view keeps.
[[nodiscard]] FrameView view_of(Sensor sensor, const Frame& frame);

/// The frame with this left image, CV_8UC3 (blue, green, red), which it keeps; without one, as it is.
[[nodiscard]] FrameView with_colour(const FrameView& frame, const cv::Mat& left);

}  // namespace twofold
