#include <algorithm>
#include <cmath>

#include "experiments/double_window/double_loop_methods.hpp"

namespace twofold::bench {
namespace {

/// Means over five steps: single ones are as uncertain as a percent or two.
Series scale_series(const LoopShot& shot, int colour) {
  Series series{.name = shot.when, .colour = colour};
  const auto count = static_cast<std::ptrdiff_t>(shot.scales.size());
  for (std::ptrdiff_t k = 0; k < count; ++k) {
    double sum = 0;
    for (std::ptrdiff_t n = -2; n <= 2; ++n) {
      sum += shot.scales[static_cast<std::size_t>(std::clamp<std::ptrdiff_t>(k + n, 0, count - 1))];
    }
    series.x.push_back(static_cast<double>(k + 1));
    series.y.push_back(100 * sum / 5);
  }
  return series;
}

Series path_series(const LoopShot& shot) {
  Series series{.name = "estimate", .colour = 0};
  for (const Vector3& c : shot.centres) {
    series.x.push_back(c.x());
    series.y.push_back(c.y());
  }
  return series;
}

}  // namespace

cv::Mat draw_loop_paths(const LoopTrials& methods, std::size_t trial, const Scene& scene) {
  Series truth{.name = "truth", .colour = 1};
  for (const SE3& T_k_w : scene.T_k_w) {
    const Vector3 c = T_k_w.inverse().translation();
    truth.x.push_back(c.x());
    truth.y.push_back(c.y());
  }
  std::vector<cv::Mat> plots;
  for (std::size_t m = 0; m < kLoopMethods; ++m) {
    for (const LoopShot& shot : methods[m][trial].shots) {
      PlotOptions plot{.title = std::string(kLoopNames[m]) + ", " + shot.when,
                       .x_label = "m",
                       .y_label = "m",
                       .equal_aspect = true,
                       .width = 560,
                       .height = 460};
      plots.push_back(draw_plot({truth, path_series(shot)}, plot));
    }
  }
  return tile(plots, 3);
}

cv::Mat draw_loop_scales(const LoopTrials& methods, std::size_t trial) {
  std::vector<cv::Mat> plots;
  for (std::size_t m = 0; m < kLoopMethods; ++m) {
    std::vector<Series> series;
    for (const LoopShot& shot : methods[m][trial].shots) {
      series.push_back(scale_series(shot, static_cast<int>(series.size())));
    }
    PlotOptions plot{.title = std::string(kLoopNames[m]) + ": scale along the path",
                     .x_label = "keyframe",
                     .y_label = "ln(estimated / true step) [%]",
                     .width = 760,
                     .height = 460};
    plots.push_back(draw_plot(series, plot));
  }
  return tile(plots, 2);
}

}  // namespace twofold::bench
