#pragma once

#include <opencv2/core/mat.hpp>
#include <string>
#include <vector>

#include "synthetic/random.hpp"

namespace twofold::synthetic {

/// A surface to be painted, in metres: x right in [0, width], y down in [0, height]. Grey levels are floats.
class Canvas {
 public:
  /// texel: edge of a texel [m]; at least 2x2 texels are made.
  Canvas(double width, double height, double texel, float grey);

  [[nodiscard]] double width() const { return width_; }
  [[nodiscard]] double height() const { return height_; }
  [[nodiscard]] double texel() const { return texel_; }
  [[nodiscard]] cv::Mat& image() { return image_; }

  void rectangle(double x, double y, double w, double h, float grey);
  void disc(double x, double y, double radius, float grey);
  void ellipse(double x, double y, double a, double b, double angle_deg, float grey);
  void polygon(const std::vector<cv::Point2d>& corners, float grey);
  void line(double x0, double y0, double x1, double y1, double thickness, float grey);
  /// Baseline of the letters starts at (x, y).
  void text(const std::string& letters, double x, double y, double letter_height, float grey);

  /// Adds value noise: octaves from wavelength `coarsest` down to `finest` [m], each weaker by `persistence`.
  void add_noise(std::uint64_t seed, float amplitude, double coarsest, double finest,
                 float persistence = 0.7f);
  /// Multiplies rows from y0 to y1 by a factor that goes linearly from f0 to f1 (dirt, shade).
  void shade_rows(double y0, double y1, float f0, float f1);

  /// Takes away what a texel grid cannot hold (3x3 binomial filter) and gives the image.
  [[nodiscard]] cv::Mat finish();

 private:
  [[nodiscard]] cv::Point pixel(double x, double y) const;  ///< with kShift fractional bits

  double width_, height_, texel_;
  cv::Mat image_;
};

}  // namespace twofold::synthetic
