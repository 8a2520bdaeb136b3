// Figures 4.10 and 4.11: motion given a map, cost of the pipelines against the number of points.
#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>

#include "experiments/plot.hpp"
#include "experiments/why_filter/experiments.hpp"
#include "experiments/why_filter/pipelines.hpp"

namespace twofold::bench {

void motion_experiment(const WhyFilterOptions& options, Report& report) {
  const std::vector<std::pair<MotionEstimate, std::string>> variants = {
      {MotionEstimate::kMotionOnly, "motion-only BA"},
      {MotionEstimate::kMapPrior, "Gaussian map"},
      {MotionEstimate::kMapPriorOnce, "Gaussian map, approximate"}};
  const std::vector<int> counts = {15, 30, 60, 120};
  std::vector<Series> error, cost;
  std::vector<std::vector<double>> rows;
  double ratio = 0, approximate = 0;
  for (const auto& [variant, name] : variants) {
    Series e{.name = name, .markers = true}, s = e;
    for (const int points : counts) {
      std::vector<double> squared(static_cast<std::size_t>(options.trials)), seconds(squared);
      tbb::parallel_for(0, options.trials, [&, kind = variant](int trial) {
        const auto t = static_cast<std::size_t>(trial);
        const Block block = simulate_block(Setting::kSideways, SensorKind::kMono, 1, points,
                                           9000u + static_cast<unsigned>(trial));
        GaussNewtonFilterOptions filter_options;
        filter_options.motion = kind;
        filter_options.iterations = 0;  // the motion estimate alone
        PipelineResult result;
        GaussNewtonFilter start(block.rig, {.iterations = 10});
        if (!start.bootstrap(block.bootstrap[0], block.bootstrap[1], block.first)) return;
        GaussNewtonFilter filter = start;
        filter.set_options(filter_options);
        const double begin = thread_seconds();
        result.ok = filter.step(block.steps[0].lost, block.steps[0].fresh, block.steps[0].current);
        seconds[t] = thread_seconds() - begin;
        result.T_last_first = filter.T_c_w() * filter.T_reference_w().inverse();
        squared[t] = end_error(block, result).squaredNorm();
      });
      double sum = 0, time = 0;
      for (std::size_t t = 0; t < squared.size(); ++t) {
        sum += squared[t] / options.trials;
        time += seconds[t] / options.trials;
      }
      e.x.push_back(points);
      e.y.push_back(std::sqrt(sum));
      s.x.push_back(points);
      s.y.push_back(time);
      rows.push_back({static_cast<double>(variant), static_cast<double>(points), std::sqrt(sum), time});
    }
    error.push_back(e);
    cost.push_back(s);
  }
  for (std::size_t n = 0; n < counts.size(); ++n) {
    ratio += std::log(error[0].y[n] / error[1].y[n]) / static_cast<double>(counts.size());
    approximate += std::log(error[2].y[n] / error[1].y[n]) / static_cast<double>(counts.size());
  }
  report.csv("fig4_10.csv", {"variant", "N", "rmse_m", "seconds"}, rows);
  PlotOptions plot{
      .title = "fig. 4.10(a): pose given the map, monocular", .x_label = "points N", .y_label = "RMSE [m]"};
  PlotOptions time{.title = "fig. 4.10(b): cost", .x_label = "points N", .y_label = "seconds"};
  plot.log_x = plot.log_y = time.log_x = time.log_y = true;
  write_png(report.file("fig4_10.png"), tile({draw_plot(error, plot), draw_plot(cost, time)}, 2));
  report.state(
      "thesis fig. 4.10",
      "monocular: taking account of the map's uncertainty makes the motion estimate better, and dearer",
      text("RMSE motion-only / Gaussian map %.2f, approximate / exact %.3f; time at N = 120: %.1f and %.1f "
           "times that of "
           "motion-only",
           std::exp(ratio), std::exp(approximate), cost[1].y.back() / cost[0].y.back(),
           cost[2].y.back() / cost[0].y.back()),
      ratio > 0 && cost[1].y.back() > cost[0].y.back());
}

void cost_experiment(const WhyFilterOptions&, Report& report) {
  const std::vector<double> counts = {15, 30, 60, 120, 240, 480};
  Series ba{.name = "BA, joint", .markers = true}, filter{.name = "filter, joint", .markers = true};
  Series ba_total{.name = "BA, whole", .markers = true, .dashed = true},
      filter_total{.name = "filter, whole", .markers = true, .dashed = true};
  std::vector<std::vector<double>> rows;
  for (const double points : counts) {
    double best[4] = {1e300, 1e300, 1e300,
                      1e300};  // least of a few runs: other work on the machine only adds
    for (unsigned trial = 0; trial < (points > 200 ? 3u : 8u); ++trial) {
      const Block block =
          simulate_block(Setting::kSideways, SensorKind::kMono, 1, static_cast<int>(points), 9500u + trial);
      const PipelineResult b = run_bundle_adjustment(block, 3),
                           f = run_filter(block, 3, MotionEstimate::kMapPriorOnce);
      if (!b.ok || !f.ok) continue;
      const double values[4] = {b.joint_seconds, f.joint_seconds, b.total_seconds, f.total_seconds};
      for (int i = 0; i < 4; ++i) best[i] = std::min(best[i], values[i]);
    }
    for (const auto& [series, value] :
         {std::pair{&ba, best[0]}, {&filter, best[1]}, {&ba_total, best[2]}, {&filter_total, best[3]}}) {
      series->x.push_back(points);
      series->y.push_back(value);
    }
    rows.push_back({points, best[0], best[1], best[2], best[3]});
  }
  report.csv("fig4_11.csv", {"N", "ba_joint_s", "filter_joint_s", "ba_total_s", "filter_total_s"}, rows);
  PlotOptions plot{
      .title = "fig. 4.11: cost of monocular SLAM, M = 1", .x_label = "points N", .y_label = "seconds"};
  plot.log_x = plot.log_y = true;
  write_png(report.file("fig4_11.png"), draw_plot({ba, filter, ba_total, filter_total}, plot));
  const auto tail = [](const std::vector<double>& v) {
    return std::vector<double>(v.end() - 3, v.end());
  };  // N >= 120
  const double ba_exponent = fitted_exponent(tail(ba.x), tail(ba.y));
  const double filter_exponent = fitted_exponent(tail(filter.x), tail(filter.y));
  report.state("thesis fig. 4.11", "cost of BA linear in N (fitted exponent 0.8 to 1.2 for N = 120 to 480)",
               text("joint exponent %.2f, whole pipeline %.2f", ba_exponent,
                    fitted_exponent(tail(ba_total.x), tail(ba_total.y))),
               ba_exponent > 0.8 && ba_exponent < 1.2);
  report.state("thesis fig. 4.11",
               "cost of the filter cubic in N (fitted exponent 2.5 to 3.2 for N = 120 to 480)",
               text("joint exponent %.2f, whole pipeline %.2f", filter_exponent,
                    fitted_exponent(tail(filter_total.x), tail(filter_total.y))),
               filter_exponent > 2.5 && filter_exponent < 3.2);
}

}  // namespace twofold::bench
