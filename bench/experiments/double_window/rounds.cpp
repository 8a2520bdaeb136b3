#include "experiments/double_window/rounds.hpp"

#include <algorithm>
#include <functional>

#include "base/processor_time.hpp"
#include "experiments/double_window/experiments.hpp"
#include "experiments/plot.hpp"

namespace twofold::bench {
namespace {

double median_of(std::vector<double> values) {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

using Curve = std::function<std::vector<double>(const MethodRounds&)>;

cv::Mat draw(const std::vector<MethodRounds>& methods, const Curve& curve, PlotOptions plot) {
  std::vector<Series> series;
  int colour = 0;
  for (const MethodRounds& method : methods) {
    Series s{.name = method.name, .y = curve(method), .colour = colour++};
    for (std::size_t k = 0; k < s.y.size(); ++k) s.x.push_back(static_cast<double>(k + 1));
    series.push_back(s);
  }
  plot.x_label = "keyframe";
  plot.width = 760;
  plot.height = 460;
  return draw_plot(series, plot);
}

}  // namespace

MapperOptions simulation_mapper_options(const DoubleWindowExperimentOptions& options) {
  MapperOptions mapper;
  mapper.max_anchors = options.max_anchors;
  mapper.max_points = kUnbounded;
  mapper.min_covisible = options.scene.min_covisible;
  mapper.edge = options.edge;
  mapper.solver.max_iterations = 3;
  // Perfect association: there are no outliers to look for, no metric loops to find, and nothing to cull.
  mapper.solver.huber_sigmas = 0;
  mapper.outlier_chi2_mono = mapper.outlier_chi2_stereo = 1e9;
  mapper.loop.enabled = mapper.culling.keyframes = mapper.culling.points = false;
  return mapper;
}

EdgeErrorSum MethodRounds::error(EdgeErrorSum Round::*level, std::size_t first, std::size_t last) const {
  EdgeErrorSum sum;
  for (const Rounds& trial : trials) {
    for (std::size_t k = first; k < last; ++k) sum.add(trial[k].*level);
  }
  return sum;
}

ScaleChange MethodRounds::scale(ScaleChange Round::*level, std::size_t first, std::size_t last) const {
  ScaleChange sum;
  for (const Rounds& trial : trials) {
    for (std::size_t k = first; k < last; ++k) sum.add(trial[k].*level);
  }
  return sum;
}

double MethodRounds::median(double Round::*figure, std::size_t first, std::size_t last) const {
  std::vector<double> values;
  for (const Rounds& trial : trials) {
    for (std::size_t k = first; k < last; ++k) values.push_back(trial[k].*figure);
  }
  return median_of(std::move(values));
}

std::vector<double> MethodRounds::rmse_curve(EdgeErrorSum Round::*level) const {
  std::vector<double> curve;
  for (std::size_t k = 0; k < keyframes(); ++k) curve.push_back(error(level, k, k + 1).rmse());
  return curve;
}

std::vector<double> MethodRounds::median_curve(double Round::*figure) const {
  std::vector<double> curve;
  for (std::size_t k = 0; k < keyframes(); ++k) curve.push_back(median(figure, k, k + 1));
  return curve;
}

double thread_cpu_ms() {
  return 1e-6 * static_cast<double>(thread_cpu_ns());
}

void record_cost(const MapperReport& report, double cpu_ms, Round& round) {
  round.cpu_ms = cpu_ms;
  round.frames = report.inner_window + report.outer_window;
  round.points = report.points;
  round.observations = report.observations;
  round.constraints = report.constraints;
}

void record_errors(const GraphSnapshot& graph, double metres_per_unit, const Scene& scene,
                   const DoubleWindow& window, Round& round) {
  const auto error = [&](const auto& use) { return relative_error(graph, metres_per_unit, scene, use); };
  round.inner = error([&](KeyframeId id) { return window.is_inner(id); });
  round.both = error([&](KeyframeId id) { return window.contains(id); });
  round.all = error([](KeyframeId) { return true; });
}

void record_scale(const GraphSnapshot& graph, const Scene& scene, const DoubleWindow& window, Round& round) {
  round.both_scale = scale_change(graph, scene, [&](KeyframeId id) { return window.contains(id); });
  round.all_scale = scale_change(graph, scene, [](KeyframeId) { return true; });
  round.shape = shape_error(graph, scene);
}

void write_rounds(const std::string& name, const std::string& title, const std::vector<MethodRounds>& methods,
                  bool scale_free, Report& report) {
  const std::pair<const char*, EdgeErrorSum Round::*> levels[] = {
      {"inner window", &Round::inner}, {"both windows", &Round::both}, {"all edges", &Round::all}};
  const std::pair<const char*, double Round::*> figures[] = {
      {"CPU time [ms]", &Round::cpu_ms},
      {"frames", &Round::frames},
      {"points", &Round::points},
      {"point-to-frame constraints", &Round::observations},
      {"frame-to-frame constraints", &Round::constraints}};
  std::vector<std::string> columns{"keyframe"};
  std::vector<std::vector<double>> rows(methods.front().keyframes());
  for (std::size_t k = 0; k < rows.size(); ++k) rows[k] = {static_cast<double>(k + 1)};
  const auto add_columns = [&](const char* label, const Curve& curve) {
    for (const MethodRounds& method : methods) {
      columns.push_back(method.name + ": " + label);
      const std::vector<double> values = curve(method);
      for (std::size_t k = 0; k < rows.size(); ++k) rows[k].push_back(values[k]);
    }
  };
  std::vector<cv::Mat> accuracy, cost;
  for (const auto& [label, level] : levels) {
    const Curve curve = [level = level](const MethodRounds& m) { return m.rmse_curve(level); };
    add_columns(label, curve);
    PlotOptions plot{.title = title + ": RMSE, " + label, .y_label = scale_free ? "of unit length" : "m"};
    plot.log_y = level == &Round::all;
    accuracy.push_back(draw(methods, curve, plot));
  }
  for (const auto& [label, figure] : figures) {
    const Curve curve = [figure = figure](const MethodRounds& m) { return m.median_curve(figure); };
    add_columns(label, curve);
    PlotOptions plot{.title = title + ": " + label, .y_label = label};
    plot.log_y = figure == &Round::cpu_ms;
    cost.push_back(draw(methods, curve, plot));
  }
  report.csv(name + ".csv", columns, rows);
  write_png(report.file(name + "_accuracy.png"), tile(accuracy, 2));
  write_png(report.file(name + "_cost.png"), tile(cost, 2));
}

}  // namespace twofold::bench
