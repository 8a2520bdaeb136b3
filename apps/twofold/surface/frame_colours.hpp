#pragma once

#include <opencv2/core/mat.hpp>
#include <string>
#include <vector>

#include "io/sources/frame_source.hpp"

namespace twofold {

/// The left images of a surface's frames, in colour where the source has it, else grey; and what is to be
/// said of that. A damaged one costs its colours only.
class FrameColours {
 public:
  /// source must outlive the object.
  explicit FrameColours(const FrameSource& source) : source_(source) {}

  /// CV_8UC3 (blue, green, red), or the frame's own, CV_8UC1.
  [[nodiscard]] cv::Mat left_image(const Frame& frame);

  /// SurfaceFigures::colour.
  [[nodiscard]] std::string text() const;
  /// Adds a line about those that could not be read, if there are any.
  void add_left_out(std::vector<std::string>& lines) const;

 private:
  const FrameSource& source_;
  int coloured_ = 0, damaged_ = 0;
  std::string defect_;  // of the newest that could not be read
};

}  // namespace twofold
