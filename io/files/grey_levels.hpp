#pragma once

#include <opencv2/core/mat.hpp>
#include <optional>
#include <string>

namespace twofold {

// Grey images of 16 bits often hold what a camera of 8, 10, 12 or 14 measures.

/// Bits that the brightest pixel takes; nothing for images of 8 bits.
[[nodiscard]] std::optional<int> wide_bits(const cv::Mat& grey);

/// The bits of a camera some images of which take as many as `used`.
[[nodiscard]] int camera_bits(int used);

/// CV_8UC1 of an image of 16 bits, whose grey levels are 2^bits: brighter ones become white. One of 8 bits is
/// returned as it is.
[[nodiscard]] cv::Mat eight_bits(const cv::Mat& grey, int bits);

/// A line for people: which levels were taken.
[[nodiscard]] std::string grey_levels_note(const std::string& recording, int bits);

}  // namespace twofold
