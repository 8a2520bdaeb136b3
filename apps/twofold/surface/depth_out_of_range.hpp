#pragma once

#include <opencv2/core/mat.hpp>
#include <string>

#include "camera/rig.hpp"

namespace twofold {

/// The readings of depth images that have none within the rig's range: a wrong unit shows by them.
class DepthOutOfRange {
 public:
  /// depth: as depth_defect wants it
  void look_at(const Rig& rig, const cv::Mat& depth);
  /// "depth images without any reading from 0.3 to 8 m", and what theirs were.
  [[nodiscard]] std::string text(const Rig& rig) const;

 private:
  double nearest_ = 0, farthest_ = 0;  // [m]; 0: none was seen yet
};

}  // namespace twofold
