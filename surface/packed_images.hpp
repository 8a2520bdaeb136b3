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

/// A colour or grey image as JPEG, in strips one below the other: a thread that makes way for others cannot
/// do so while a library encodes or decodes an image, which takes milliseconds for a whole one.
class PackedColour {
 public:
  PackedColour() = default;
  /// image: CV_8UC1 or CV_8UC3.
  explicit PackedColour(const cv::Mat& image);

  [[nodiscard]] bool empty() const { return strips_.empty(); }
  /// Of the image's size and type.
  [[nodiscard]] cv::Mat unpacked() const;
  [[nodiscard]] std::size_t bytes() const;

 private:
  int rows_ = 0;
  int cols_ = 0;
  int type_ = 0;
  std::vector<std::vector<std::uint8_t>> strips_;
};

}  // namespace twofold
