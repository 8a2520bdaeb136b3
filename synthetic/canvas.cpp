#include "synthetic/canvas.hpp"

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>

namespace twofold::synthetic {
namespace {

constexpr int kShift = 4;  ///< fractional bits of the coordinates handed to the drawing functions

/// No two of these overlap: the compiler may look up eight lattice values at once.
void add_interpolated(const float* __restrict lattice, const int* __restrict cell,
                      const float* __restrict weight, int n, float* __restrict out) {
  for (int x = 0; x < n; ++x) {
    const float left = lattice[cell[x]], right = lattice[cell[x] + 1];
    out[x] += left + weight[x] * (right - left);
  }
}

/// One octave of value noise on rows of the image: a lattice of random values, smoothly interpolated.
void add_octave(cv::Mat& image, std::uint64_t seed, float amplitude, double wavelength_texels) {
  const auto step = static_cast<float>(1.0 / wavelength_texels);
  const int columns = static_cast<int>(static_cast<float>(image.cols) * step) + 3;
  std::vector<int> cell(image.cols);
  std::vector<float> weight(image.cols);
  for (int x = 0; x < image.cols; ++x) {
    const float u = static_cast<float>(x) * step;
    cell[x] = static_cast<int>(u);
    const float a = u - static_cast<float>(cell[x]);
    weight[x] = a * a * (3 - 2 * a);
  }
  const auto fill = [&](int row, std::vector<float>& lattice) {
    for (int i = 0; i < columns; ++i)
      lattice[i] = amplitude * static_cast<float>(2 * unit_interval(counter_hash(seed, row, i)) - 1);
  };
  std::vector<float> above(columns), below(columns), blend(columns);
  int current = -1;
  for (int y = 0; y < image.rows; ++y) {
    const float v = static_cast<float>(y) * step;
    const int row = static_cast<int>(v);
    if (row != current) {
      fill(row, above);
      fill(row + 1, below);
      current = row;
    }
    const float b = v - static_cast<float>(row);
    const float w = b * b * (3 - 2 * b);
    for (int i = 0; i < columns; ++i) blend[i] = above[i] + w * (below[i] - above[i]);
    add_interpolated(blend.data(), cell.data(), weight.data(), image.cols, image.ptr<float>(y));
  }
}

}  // namespace

Canvas::Canvas(double width, double height, double texel, float grey)
    : width_(width),
      height_(height),
      texel_(texel),
      image_(std::max(2, static_cast<int>(std::lround(height / texel))),
             std::max(2, static_cast<int>(std::lround(width / texel))), CV_32FC1, cv::Scalar(grey)) {}

cv::Point Canvas::pixel(double x, double y) const {
  // Texel i has its centre at (i + 0.5) texel.
  return {static_cast<int>(std::lround((x / texel_ - 0.5) * (1 << kShift))),
          static_cast<int>(std::lround((y / texel_ - 0.5) * (1 << kShift)))};
}

void Canvas::rectangle(double x, double y, double w, double h, float grey) {
  const auto left = static_cast<int>(std::lround(x / texel_));
  const auto top = static_cast<int>(std::lround(y / texel_));
  const auto right = static_cast<int>(std::lround((x + w) / texel_));
  const auto bottom = static_cast<int>(std::lround((y + h) / texel_));
  const cv::Rect r =
      cv::Rect(left, top, right - left, bottom - top) & cv::Rect(0, 0, image_.cols, image_.rows);
  if (r.area() > 0) image_(r).setTo(grey);
}

void Canvas::disc(double x, double y, double radius, float grey) {
  cv::circle(image_, pixel(x, y), static_cast<int>(std::lround(radius / texel_ * (1 << kShift))), grey,
             cv::FILLED, cv::LINE_8, kShift);
}

void Canvas::ellipse(double x, double y, double a, double b, double angle_deg, float grey) {
  const auto length = [&](double v) { return static_cast<int>(std::lround(v / texel_ * (1 << kShift))); };
  cv::ellipse(image_, pixel(x, y), {length(a), length(b)}, angle_deg, 0, 360, grey, cv::FILLED, cv::LINE_8,
              kShift);
}

void Canvas::polygon(const std::vector<cv::Point2d>& corners, float grey) {
  std::vector<cv::Point> points;
  for (const auto& c : corners) points.push_back(pixel(c.x, c.y));
  cv::fillPoly(image_, std::vector<std::vector<cv::Point>>{points}, grey, cv::LINE_8, kShift);
}

void Canvas::line(double x0, double y0, double x1, double y1, double thickness, float grey) {
  const int t = std::max(1, static_cast<int>(std::lround(thickness / texel_)));
  cv::line(image_, pixel(x0, y0), pixel(x1, y1), grey, t, cv::LINE_8, kShift);
}

void Canvas::text(const std::string& letters, double x, double y, double letter_height, float grey) {
  const double scale = letter_height / texel_ / 21.0;  // capitals of this font are 21 texels high
  const int thickness = std::max(1, static_cast<int>(std::lround(3.0 * scale)));
  const cv::Point at(static_cast<int>(std::lround(x / texel_)), static_cast<int>(std::lround(y / texel_)));
  cv::putText(image_, letters, at, cv::FONT_HERSHEY_SIMPLEX, scale, grey, thickness);
}

void Canvas::add_noise(std::uint64_t seed, float amplitude, double coarsest, double finest,
                       float persistence) {
  std::uint64_t octave = 0;
  for (double wavelength = coarsest; wavelength >= finest && wavelength > 1.5 * texel_; wavelength *= 0.5) {
    add_octave(image_, mix64(seed + octave++), amplitude, wavelength / texel_);
    amplitude *= persistence;
  }
}

void Canvas::shade_rows(double y0, double y1, float f0, float f1) {
  for (int y = 0; y < image_.rows; ++y) {
    const double at = (y + 0.5) * texel_;
    if (at < y0 || at > y1) continue;
    const float factor = f0 + (f1 - f0) * static_cast<float>((at - y0) / (y1 - y0));
    auto* row = image_.ptr<float>(y);
    for (int x = 0; x < image_.cols; ++x) row[x] *= factor;
  }
}

cv::Mat Canvas::finish() {
  const int w = image_.cols;
  const int h = image_.rows;
  std::vector<float> previous(w), current(w), next(w);
  const auto horizontal = [&](int y, std::vector<float>& out) {
    const auto* row = image_.ptr<float>(std::clamp(y, 0, h - 1));
    for (int x = 1; x + 1 < w; ++x) out[x] = 0.25f * (row[x - 1] + row[x + 1]) + 0.5f * row[x];
    out[0] = 0.75f * row[0] + 0.25f * row[1];
    out[w - 1] = 0.75f * row[w - 1] + 0.25f * row[w - 2];
  };
  horizontal(0, previous);
  current = previous;
  for (int y = 0; y < h; ++y) {
    horizontal(y + 1, next);  // reads row y + 1, which is still unfiltered
    auto* row = image_.ptr<float>(y);
    for (int x = 0; x < w; ++x) row[x] = 0.25f * (previous[x] + next[x]) + 0.5f * current[x];
    std::swap(previous, current);
    std::swap(current, next);
  }
  return image_;
}

}  // namespace twofold::synthetic
