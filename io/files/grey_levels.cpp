#include "io/files/grey_levels.hpp"

#include <algorithm>
#include <cmath>
#include <opencv2/core.hpp>

#include <fmt/format.h>

namespace twofold {

std::optional<int> wide_bits(const cv::Mat& grey) {
  if (grey.depth() == CV_8U) return std::nullopt;
  double brightest = 0;
  cv::minMaxLoc(grey, nullptr, &brightest);
  return std::ilogb(std::max(brightest, 0.5)) + 1;
}

int camera_bits(int used) {
  return std::clamp((used + 1) / 2 * 2, 8, 16);
}

cv::Mat eight_bits(const cv::Mat& grey, int bits) {
  if (grey.depth() == CV_8U) return grey;
  cv::Mat image;
  grey.convertTo(image, CV_8U, std::ldexp(1.0, 8 - bits));
  return image;
}

std::string grey_levels_note(const std::string& recording, int bits) {
  return fmt::format("{}: images of 16 bits hold {}: grey levels were taken from 0 to {}", recording, bits,
                     (1 << bits) - 1);
}

}  // namespace twofold
