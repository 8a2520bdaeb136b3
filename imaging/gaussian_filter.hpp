#pragma once

#include <opencv2/core/mat.hpp>

namespace twofold {

/// Gaussian of two pixels, cut off after three and rounded to 256ths; the result is rounded to whole grey
/// levels. The same numbers on every machine, and no thread is started.
///
/// Keeps its buffer: the second image of the same size allocates nothing. One instance a thread.
class GaussianFilter {
 public:
  static constexpr int kBorder = 3;  ///< pixels along the edges that `smooth` has no meaning at

  /// @param image   CV_8UC1, larger than twice the border
  /// @param smooth  of the same size; another image
  void apply(const cv::Mat& image, cv::Mat& smooth);

 private:
  cv::Mat rows_;  ///< smoothed along the rows [grey / 256]
};

}  // namespace twofold
