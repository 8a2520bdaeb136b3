#pragma once

#include <filesystem>
#include <opencv2/core/mat.hpp>
#include <string>
#include <vector>

#include "evaluation/trajectory.hpp"

namespace twofold {

/// A path to draw. With `values` (one a position) it is coloured by them and a colour bar is drawn.
struct PlotTrack {
  std::string name;
  std::vector<Vector3> x_w;  ///< positions [m], or of an arbitrary unit (PlotOptions::metric)
  cv::Scalar bgr{0, 0, 0};
  int width_px = 2;
  std::vector<double> values;
};

namespace plot_colours {
inline const cv::Scalar kTruth{150, 150, 150};
inline const cv::Scalar kFinal{200, 90, 20};
inline const cv::Scalar kCausal{60, 130, 240};
}  // namespace plot_colours

struct PlotOptions {
  std::string title;
  std::string subtitle;
  std::string value_label = "error [m]";
  bool metric = true;   ///< positions are in metres; else the axes say no unit
  int up_axis = 2;      ///< axis of the world to look along: 0, 1 or 2; see up_axis_of
  int long_side = 760;  ///< of the area inside the axes, before margins [px] >= 1

  /// Empty when valid; otherwise names the field, the rule and the value.
  [[nodiscard]] std::string invalid_reason() const;
};

/// Axis of the world (0, 1, 2) that the cameras' vertical is nearest to on average. Recordings differ: in
/// KITTI's world y points down, motion capture rooms have z up.
[[nodiscard]] int up_axis_of(const Trajectory& trajectory);

/// Paths seen from above: same scale on both axes, ticks with their unit, legend, start and end marked.
/// CV_8UC3. Tracks without positions are left out.
[[nodiscard]] cv::Mat draw_top_down(const std::vector<PlotTrack>& tracks, const PlotOptions& options);

/// Throws IoError when the file cannot be written.
void write_png(const std::filesystem::path& file, const cv::Mat& image);

[[nodiscard]] std::vector<Vector3> positions(const Trajectory& trajectory);

}  // namespace twofold
