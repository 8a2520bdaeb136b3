#pragma once

#include <limits>
#include <opencv2/core.hpp>
#include <string>
#include <vector>

namespace twofold::bench {

/// One curve of a plot. Points with a NaN, or not positive on a logarithmic axis, break the line.
struct Series {
  std::string name = {};  ///< legend text; empty: not in the legend
  std::vector<double> x = {}, y = {};
  bool line = true;
  bool markers = false;
  bool dashed = false;
  int colour = -1;  ///< index into the palette; -1: next free one
  int thickness = 2;
};

struct PlotOptions {
  std::string title = {}, x_label = {}, y_label = {};
  bool log_x = false, log_y = false;
  bool equal_aspect = false;  ///< same scale on both axes (trajectories); linear axes only
  int width = 900, height = 600;
  /// Axis limits; NaN: from the data.
  double x_min = NaN, x_max = NaN, y_min = NaN, y_max = NaN;

  static constexpr double NaN = std::numeric_limits<double>::quiet_NaN();
};

/// Line plot with axes, ticks, grid and legend as an 8-bit BGR image.
[[nodiscard]] cv::Mat draw_plot(const std::vector<Series>& series, const PlotOptions& options);

/// Images of equal size side by side, `columns` a row.
[[nodiscard]] cv::Mat tile(const std::vector<cv::Mat>& images, int columns);

/// Writes a PNG; throws std::runtime_error naming the file when that fails.
void write_png(const std::string& file, const cv::Mat& image);

}  // namespace twofold::bench
