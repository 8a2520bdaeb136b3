#include "experiments/plot.hpp"

#include <algorithm>
#include <cmath>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <stdexcept>

namespace twofold::bench {
namespace {

const std::vector<cv::Scalar> kPalette = {{180, 119, 31},  {14, 127, 255}, {44, 160, 44},   {40, 39, 214},
                                          {189, 103, 148}, {75, 86, 140},  {194, 119, 227}, {127, 127, 127},
                                          {34, 189, 188},  {207, 190, 23}};
const cv::Scalar kInk(40, 40, 40), kGrid(225, 225, 225);
constexpr int kFont = cv::FONT_HERSHEY_SIMPLEX;

cv::Size text_size(const std::string& text, double scale) {
  int baseline = 0;
  return cv::getTextSize(text, kFont, scale, 1, &baseline);
}

void put(cv::Mat& image, const std::string& text, cv::Point at, double scale = 0.45) {
  cv::putText(image, text, at, kFont, scale, kInk, 1, cv::LINE_AA);
}

std::string number(double v) {
  char text[32];
  std::snprintf(text, sizeof text, "%.4g", std::abs(v) < 1e-14 ? 0.0 : v);
  return text;
}

/// Maps one axis to pixels and knows its ticks.
struct Axis {
  double low = 0, high = 1;  // in log10 when `log`
  bool log = false;
  double p0 = 0, p1 = 1;  // pixels of low and high

  [[nodiscard]] double value(double v) const { return log ? (v > 0 ? std::log10(v) : std::nan("")) : v; }
  [[nodiscard]] double pixel(double v) const { return p0 + (value(v) - low) / (high - low) * (p1 - p0); }

  [[nodiscard]] std::vector<double> ticks() const {
    std::vector<double> result;
    if (log) {
      const bool dense = high - low < 1.6;
      for (int e = static_cast<int>(std::floor(low)); e <= static_cast<int>(std::ceil(high)); ++e) {
        for (const int k : dense ? std::vector<int>{1, 2, 3, 5, 7} : std::vector<int>{1}) {
          const double v = k * std::pow(10.0, e);
          if (std::log10(v) >= low - 1e-9 && std::log10(v) <= high + 1e-9) result.push_back(v);
        }
      }
      return result;
    }
    const double raw = (high - low) / 6;
    const double unit = std::pow(10.0, std::floor(std::log10(raw)));
    double step = unit;
    for (const double k : {1.0, 2.0, 5.0, 10.0}) {
      step = k * unit;
      if (step >= raw) break;
    }
    for (double v = std::ceil(low / step - 1e-9) * step; v <= high + 1e-9 * step; v += step)
      result.push_back(v);
    return result;
  }
};

Axis make_axis(const std::vector<Series>& series, bool x, bool log, double low, double high) {
  Axis axis;
  axis.log = log;
  double least = 1e300, most = -1e300;
  for (const Series& s : series) {
    for (const double v : x ? s.x : s.y) {
      const double u = axis.value(v);
      if (!std::isfinite(u)) continue;
      least = std::min(least, u);
      most = std::max(most, u);
    }
  }
  if (least > most) least = 0, most = 1;
  if (most - least < 1e-12) least -= 0.5, most += 0.5;
  const double margin = x ? 0.0 : 0.04 * (most - least);
  axis.low = std::isnan(low) ? least - margin : axis.value(low);
  axis.high = std::isnan(high) ? most + margin : axis.value(high);
  return axis;
}

void widen_to_equal_aspect(Axis& x, Axis& y) {
  const double per_px_x = (x.high - x.low) / std::abs(x.p1 - x.p0);
  const double per_px_y = (y.high - y.low) / std::abs(y.p1 - y.p0);
  Axis& a = per_px_x < per_px_y ? x : y;
  const double extra = (std::max(per_px_x, per_px_y) * std::abs(a.p1 - a.p0) - (a.high - a.low)) / 2;
  a.low -= extra;
  a.high += extra;
}

void draw_axes(cv::Mat& image, const Axis& x, const Axis& y, const PlotOptions& options,
               const cv::Rect& box) {
  for (const double v : x.ticks()) {
    const int p = static_cast<int>(std::lround(x.pixel(v)));
    cv::line(image, {p, box.y}, {p, box.y + box.height}, kGrid, 1);
    put(image, number(v), {p - text_size(number(v), 0.45).width / 2, box.y + box.height + 18});
  }
  for (const double v : y.ticks()) {
    const int p = static_cast<int>(std::lround(y.pixel(v)));
    cv::line(image, {box.x, p}, {box.x + box.width, p}, kGrid, 1);
    put(image, number(v), {box.x - 8 - text_size(number(v), 0.45).width, p + 4});
  }
  cv::rectangle(image, box, kInk, 1);
  put(image, options.title, {box.x + (box.width - text_size(options.title, 0.6).width) / 2, 24}, 0.6);
  put(image, options.x_label,
      {box.x + (box.width - text_size(options.x_label, 0.5).width) / 2, box.y + box.height + 42}, 0.5);
  const cv::Size size = text_size(options.y_label, 0.5);
  if (size.width == 0) return;
  cv::Mat label(size.height + 10, size.width + 4, CV_8UC3, cv::Scalar::all(255));
  put(label, options.y_label, {2, size.height + 3}, 0.5);
  cv::rotate(label, label, cv::ROTATE_90_COUNTERCLOCKWISE);
  const int top = std::clamp(box.y + (box.height - label.rows) / 2, 0, std::max(0, image.rows - label.rows));
  label = label.rowRange(0, std::min(label.rows, image.rows));
  label.copyTo(image(cv::Rect(4, top, label.cols, label.rows)));
}

void draw_segment(cv::Mat& image, cv::Point2d a, cv::Point2d b, const cv::Scalar& colour, const Series& s,
                  double& phase) {
  constexpr int kShift = 4;
  const auto fixed = [](cv::Point2d p) {
    const double limit = 1e6;
    return cv::Point(static_cast<int>(std::lround(std::clamp(p.x, -limit, limit) * (1 << kShift))),
                     static_cast<int>(std::lround(std::clamp(p.y, -limit, limit) * (1 << kShift))));
  };
  if (!s.dashed) {
    cv::line(image, fixed(a), fixed(b), colour, s.thickness, cv::LINE_AA, kShift);
    return;
  }
  const double length = std::min(cv::norm(b - a), 1e4);
  for (double at = 0; at < length; at += 1) {  // 7 px on, 5 px off along the whole curve
    if (std::fmod(phase + at, 12.0) < 7.0) {
      const cv::Point2d p = a + (b - a) * (at / length),
                        q = a + (b - a) * (std::min(length, at + 1) / length);
      cv::line(image, fixed(p), fixed(q), colour, s.thickness, cv::LINE_AA, kShift);
    }
  }
  phase = std::fmod(phase + length, 12.0);
}

void draw_series(cv::Mat& area, const Series& s, const Axis& x, const Axis& y, const cv::Scalar& colour,
                 cv::Point offset) {
  bool has_last = false;
  cv::Point2d last;
  double phase = 0;
  for (std::size_t i = 0; i < std::min(s.x.size(), s.y.size()); ++i) {
    const cv::Point2d p(x.pixel(s.x[i]) - offset.x, y.pixel(s.y[i]) - offset.y);
    const bool good = std::isfinite(p.x) && std::isfinite(p.y);
    if (good && has_last && s.line) draw_segment(area, last, p, colour, s, phase);
    if (good && s.markers && std::abs(p.x) < 1e5 && std::abs(p.y) < 1e5) {
      cv::circle(area, p, s.thickness + 2, colour, cv::FILLED, cv::LINE_AA);
    }
    last = p;
    has_last = good;
  }
}

}  // namespace

cv::Mat draw_plot(const std::vector<Series>& series, const PlotOptions& options) {
  cv::Mat image(options.height, options.width, CV_8UC3, cv::Scalar::all(255));
  std::vector<cv::Scalar> colours;
  int legend_width = 0, next = 0;
  for (const Series& s : series) {
    const auto index = static_cast<std::size_t>(s.colour >= 0 ? s.colour : next++);
    colours.push_back(kPalette[index % kPalette.size()]);
    if (!s.name.empty()) legend_width = std::max(legend_width, text_size(s.name, 0.45).width + 46);
  }
  // The legend stands beside the axes so that it never hides data.
  const cv::Rect box(86, 40, options.width - 86 - 16 - legend_width, options.height - 40 - 60);
  Axis x = make_axis(series, true, options.log_x, options.x_min, options.x_max);
  Axis y = make_axis(series, false, options.log_y, options.y_min, options.y_max);
  x.p0 = box.x, x.p1 = box.x + box.width;
  y.p0 = box.y + box.height, y.p1 = box.y;
  if (options.equal_aspect) widen_to_equal_aspect(x, y);
  draw_axes(image, x, y, options, box);
  cv::Mat area = image(box);
  int row = 0;
  for (std::size_t i = 0; i < series.size(); ++i) {
    draw_series(area, series[i], x, y, colours[i], box.tl());
    if (series[i].name.empty()) continue;
    const int at = box.y + 14 + 20 * row++;
    const int left = box.x + box.width + 10;
    double phase = 0;
    if (series[i].line) {
      draw_segment(image, cv::Point2d(left, at), cv::Point2d(left + 26, at), colours[i], series[i], phase);
    }
    if (series[i].markers)
      cv::circle(image, {left + 13, at}, series[i].thickness + 2, colours[i], cv::FILLED, cv::LINE_AA);
    put(image, series[i].name, {left + 32, at + 5});
  }
  cv::rectangle(image, box, kInk, 1);
  return image;
}

cv::Mat tile(const std::vector<cv::Mat>& images, int columns) {
  if (images.empty()) return {};
  const int rows = (static_cast<int>(images.size()) + columns - 1) / columns;
  cv::Mat all(rows * images[0].rows, columns * images[0].cols, CV_8UC3, cv::Scalar::all(255));
  for (std::size_t i = 0; i < images.size(); ++i) {
    const int r = static_cast<int>(i) / columns, c = static_cast<int>(i) % columns;
    images[i].copyTo(all(cv::Rect(c * images[0].cols, r * images[0].rows, images[i].cols, images[i].rows)));
  }
  return all;
}

void write_png(const std::string& file, const cv::Mat& image) {
  bool written = false;
  try {
    written = cv::imwrite(file, image);
  } catch (const cv::Exception&) {
  }
  if (!written) throw std::runtime_error("cannot write the plot " + file);
}

}  // namespace twofold::bench
