#pragma once

#include <opencv2/core/mat.hpp>
#include <string>

namespace twofold::plot_ink {

inline constexpr int kSuper =
    2;  // drawn twice as large and averaged down: thin lines and letters come out smooth
inline const cv::Scalar kInk(60, 60, 60), kGrid(232, 232, 232), kWhite(255, 255, 255);

enum class Anchor { kLeft, kCentre, kRight };

/// Text on the large canvas: `at` is a point of it, `size` the height as seen in the picture at the end.
void put_text(cv::Mat& canvas, const std::string& text, cv::Point at, double size, Anchor anchor,
              const cv::Scalar& colour = kInk, int weight = 1);

/// `text` with its middle left out where it is wider than `width` of the picture at the end: a source's path
/// tells most at its two ends.
[[nodiscard]] std::string shortened(const std::string& text, double size, int width);

/// The picture: the large canvas averaged down.
[[nodiscard]] cv::Mat shrink(const cv::Mat& canvas);

}  // namespace twofold::plot_ink
