// Sideways motion with landmarks coming and going (fig. 15), track length against window (fig. 16).
#include <tbb/parallel_for.h>

#include <cmath>
#include <numeric>

#include "experiments/plot.hpp"
#include "experiments/sliding_window/experiments.hpp"
#include "experiments/sliding_window/simulation.hpp"

namespace twofold::bench {
namespace {

double footprint(const Rig& rig, double range) {
  return 2 * range * 512 / rig.camera.fx;
}

struct FilterVariant {
  std::string name;
  int window;
  Linearisation linearisation;
};

const std::vector<FilterVariant>& sideways_variants() {
  static const std::vector<FilterVariant> kFilterVariants = {
      {"batch", 0, Linearisation::kCurrent},
      {"window 10", 10, Linearisation::kFirstEstimate},
      {"window 5", 5, Linearisation::kFirstEstimate},
      {"window 2", 2, Linearisation::kFirstEstimate},
      {"window 10, current", 10, Linearisation::kCurrent},
      {"window 2, current", 2, Linearisation::kCurrent},
      {"window 1 (EKF)", 1, Linearisation::kCurrent}};
  return kFilterVariants;
}

RunOptions sideways_options(const Rig& rig) {
  RunOptions options;
  options.frames = 40;
  options.landmarks = 25;
  options.overlap_axis = 1;
  options.step = Vector3(0.15 * footprint(rig, options.range), 0, 0);
  return options;
}

/// Squared error of the newest position at each frame [m^2].
std::vector<double> squared_errors(const Rig& rig, const FilterVariant& variant, const Run& run) {
  SlidingWindowOptions swf;
  swf.window = variant.window;
  swf.linearisation = variant.linearisation;
  swf.robust = false;
  SlidingWindowFilter filter(rig, swf);
  filter.set_first_pose(SE3(), std::nullopt);
  std::vector<double> errors;
  for (std::size_t j = 0; j < run.frames.size(); ++j) {
    filter.step(run.frames[j]);
    const SE3 error = filter.newest_T_c_w().inverse() * run.T_c_w[j];
    errors.push_back(error.translation().squaredNorm());
  }
  return errors;
}

/// Of each variant, at each frame: the mean of squared_errors over all trials.
std::vector<std::vector<double>> mean_squared_errors(int trials) {
  const Rig rig = landing_rig();
  const RunOptions run_options = sideways_options(rig);
  const std::vector<FilterVariant>& variants = sideways_variants();
  std::vector<std::vector<std::vector<double>>> of_trial(static_cast<std::size_t>(trials));
  tbb::parallel_for(0, trials, [&](int trial) {
    const Run run = simulate(rig, run_options, 2000u + static_cast<unsigned>(trial));
    for (const FilterVariant& variant : variants)
      of_trial[static_cast<std::size_t>(trial)].push_back(squared_errors(rig, variant, run));
  });
  const auto frames = static_cast<std::size_t>(run_options.frames);
  std::vector<std::vector<double>> means(variants.size(), std::vector<double>(frames));
  for (const auto& errors : of_trial)
    for (std::size_t v = 0; v < variants.size(); ++v)
      for (std::size_t j = 0; j < frames; ++j) means[v][j] += errors[v][j] / trials;
  return means;
}

void draw_sideways(const std::vector<std::vector<double>>& mean_squares, Report& report) {
  const std::size_t frames = mean_squares.front().size();
  std::vector<Series> series;
  std::vector<std::vector<double>> rows(frames);
  std::vector<std::string> columns = {"frame"};
  for (std::size_t j = 0; j < frames; ++j) rows[j].push_back(static_cast<double>(j + 1));
  for (std::size_t v = 0; v < mean_squares.size(); ++v) {
    Series s{.name = sideways_variants()[v].name};
    for (std::size_t j = 0; j < frames; ++j) {
      s.x.push_back(static_cast<double>(j + 1));
      s.y.push_back(std::sqrt(mean_squares[v][j]));
      rows[j].push_back(s.y.back());
    }
    columns.push_back(s.name);
    series.push_back(s);
  }
  report.csv("fig15_sideways.csv", columns, rows);
  write_png(report.file("fig15_sideways.png"),
            draw_plot(series, {.title = "SWF fig. 15: sideways motion, 85 % overlap, 25 features a frame",
                               .x_label = "frame",
                               .y_label = "RMS position error of the newest pose [m]"}));
}

}  // namespace

void sideways_experiment(const SlidingWindowExperimentOptions& options, Report& report) {
  const auto mean_squares = mean_squared_errors(options.trials);
  draw_sideways(mean_squares, report);
  std::vector<double> total;
  for (const std::vector<double>& of_variant : mean_squares)
    total.push_back(std::accumulate(of_variant.begin(), of_variant.end(), 0.0));
  const auto ratio = [&](std::size_t v) { return std::sqrt(total[v] / total[0]); };
  const double batch = std::sqrt(total[0] / static_cast<double>(mean_squares.front().size()));
  // The paper's filter takes all derivatives at current estimates; first estimates cure most of what it
  // shows.
  report.state(
      "SWF fig. 15",
      "sideways, the 2-frame window suffers (RMS error 10 % above batch) where 10 does not; derivatives at "
      "current estimates as in the paper",
      text("RMS over all frames relative to batch: 10: %.3f, 2: %.3f, 1 (EKF): %.3f; batch %.3f m", ratio(4),
           ratio(5), ratio(6), batch),
      ratio(5) > 1.1 && ratio(4) < 1.1);
  report.state(
      "SWF fig. 15", "with first-estimate derivatives even 2 frames stay within 10 % of batch (ours)",
      text("10: %.3f, 5: %.3f, 2: %.3f", ratio(1), ratio(2), ratio(3)), ratio(3) < 1.1 && ratio(1) < 1.1);
}

void track_length_experiment(const SlidingWindowExperimentOptions& options, Report& report) {
  const Rig rig = landing_rig();
  const std::vector<int> windows = {1, 2, 3, 5, 8, 12}, lengths = {3, 5, 8, 12, 16};
  const int trials = std::max(4, options.trials / 2);
  std::vector<std::vector<double>> rows;
  std::vector<Series> series;
  std::vector<std::vector<double>> mse(lengths.size(), std::vector<double>(windows.size()));
  for (std::size_t i = 0; i < lengths.size(); ++i) {
    RunOptions run_options;
    run_options.frames = 30;
    run_options.landmarks = 30;
    run_options.overlap_axis = 1;
    run_options.step = Vector3(footprint(rig, run_options.range) / lengths[i], 0, 0);
    std::vector<std::vector<double>> cells(static_cast<std::size_t>(trials),
                                           std::vector<double>(windows.size()));
    tbb::parallel_for(0, trials, [&](int trial) {
      const Run run = simulate(rig, run_options, 3000u + static_cast<unsigned>(trial));
      for (std::size_t w = 0; w < windows.size(); ++w) {
        SlidingWindowOptions swf;
        swf.window = windows[w];
        swf.robust = false;
        SlidingWindowFilter filter(rig, swf);
        filter.set_first_pose(SE3(), std::nullopt);
        for (std::size_t j = 0; j < run.frames.size(); ++j) {
          filter.step(run.frames[j]);
          if (j >= 20) cells[static_cast<std::size_t>(trial)][w] += camera_relative_error(filter, run) / 10;
        }
      }
    });
    for (std::size_t w = 0; w < windows.size(); ++w) {
      for (const auto& cell : cells) mse[i][w] += cell[w] / trials;
      rows.push_back({static_cast<double>(lengths[i]), static_cast<double>(windows[w]), mse[i][w]});
    }
  }
  for (std::size_t w = 0; w < windows.size(); ++w) {
    Series s{.name = "window " + std::to_string(windows[w])};
    s.markers = true;
    for (std::size_t i = 0; i < lengths.size(); ++i) {
      s.x.push_back(lengths[i]);
      s.y.push_back(mse[i][w]);
    }
    series.push_back(s);
  }
  report.csv("fig16_track_length.csv", {"track_length", "window", "mse_m2"}, rows);
  PlotOptions plot{.title = "SWF fig. 16: map error against track length and window",
                   .x_label = "average track length [frames]",
                   .y_label = "mean squared error of visible landmarks [m^2]"};
  plot.log_y = true;
  write_png(report.file("fig16_track_length.png"), draw_plot(series, plot));
  double by_window = 0;
  for (const auto& row : mse) {
    by_window = std::max(by_window, *std::max_element(row.begin() + 1, row.end()) /
                                        *std::min_element(row.begin() + 1, row.end()));
  }
  double by_length = 1e300;
  for (std::size_t w = 1; w < windows.size(); ++w)
    by_length = std::min(by_length, mse.front()[w] / mse.back()[w]);
  report.state("SWF fig. 16", "track length matters more than window size (windows of 2 and more)",
               text("over windows 2-12 the error changes at most %.2f times, over track lengths 3-16 at "
                    "least %.2f times",
                    by_window, by_length),
               by_length > by_window);
}

}  // namespace twofold::bench
