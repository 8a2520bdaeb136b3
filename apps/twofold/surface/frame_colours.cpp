#include "apps/twofold/surface/frame_colours.hpp"

#include <fmt/format.h>

#include "io/files/io_error.hpp"

namespace twofold {

cv::Mat FrameColours::left_image(const Frame& frame) {
  try {
    const cv::Mat colour = source_.colour_image(frame.index);
    if (colour.empty()) return frame.left;
    ++coloured_;
    return colour;
  } catch (const IoError& error) {
    defect_ = error.what();
    ++damaged_;
    return frame.left;
  }
}

std::string FrameColours::text() const {
  if (coloured_ > 0) return "of the recording";
  return damaged_ > 0 ? "grey: the source's cannot be read" : "grey: the source gives no other";
}

void FrameColours::add_left_out(std::vector<std::string>& lines) const {
  if (damaged_ > 0) lines.push_back(fmt::format("the colours of {} images: {}", damaged_, defect_));
}

}  // namespace twofold
