#pragma once

#include <cstdint>
#include <opencv2/core/mat.hpp>
#include <vector>

namespace twofold {

/// Gaussian of two pixels, cut off after three and rounded to 256ths; the result is rounded to whole grey
/// levels. The same numbers on every machine, and no thread is started.
///
/// Keeps its buffer: no image allocates that is not larger than all before it. One instance a thread.
class GaussianFilter {
 public:
  static constexpr int kBorder = 3;  ///< pixels along the edges that `smooth` has no meaning at

  /// @param image   CV_8UC1, larger than twice the border
  /// @param smooth  another image; made of the same size unless it is
  void apply(const cv::Mat& image, cv::Mat& smooth);

 private:
  std::vector<std::uint16_t> rows_;  ///< the last ones, smoothed along themselves [grey / 256]
};

}  // namespace twofold
