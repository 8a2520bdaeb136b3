#pragma once

#include <cstdint>
#include <opencv2/core/mat.hpp>
#include <vector>

namespace twofold {

/// A depth image of 16 bits without loss in about half of its bytes: differences between the readings of a
/// row in as many bits as the largest of sixteen needs, so that unpacking costs little beside fusion.
class PackedDepth {
 public:
  PackedDepth() = default;
  /// depth: CV_16UC1.
  explicit PackedDepth(const cv::Mat& depth);

  [[nodiscard]] bool empty() const { return bytes_.empty(); }
  [[nodiscard]] cv::Mat unpacked() const;
  [[nodiscard]] std::size_t bytes() const { return bytes_.size(); }

 private:
  int rows_ = 0;
  int cols_ = 0;
  std::vector<std::uint8_t> bytes_;
};

}  // namespace twofold
