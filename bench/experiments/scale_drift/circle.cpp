// Figure 5.5: monocular exploration of a circle, closed over SE(3) and over Sim(3).
#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "experiments/plot.hpp"
#include "experiments/scale_drift/experiments.hpp"
#include "experiments/scale_drift/trial.hpp"

namespace twofold::bench {
namespace {

/// Means over the trials of one noise level.
struct Level {
  double noise_px = 0;
  int trials = 0, lost = 0;          ///< lost: exploration or loop search failed
  int better = 0;                    ///< trials in which Sim(3) has the lower error
  std::array<double, 3> rmse{};      ///< [m]
  std::array<double, 3> rmse_max{};  ///< [m]
  double drift = 0;                  ///< of max(s, 1 / s) - 1, s the loop's scale
};

Level summarise(double noise_px, const std::vector<DriftTrial>& trials) {
  Level level;
  level.noise_px = noise_px;
  for (const DriftTrial& t : trials) {
    ++level.trials;
    level.lost += !t.ok;
    if (!t.ok) continue;
    level.better += t.rmse[kSim3] < t.rmse[kSe3];
    level.drift += std::exp(std::abs(std::log(t.loops.front().S_j_i.scale()))) - 1;
    for (const Method m : {kExplored, kSe3, kSim3}) {
      level.rmse[m] += t.rmse[m];
      level.rmse_max[m] = std::max(level.rmse_max[m], t.rmse[m]);
    }
  }
  const int found = std::max(1, level.trials - level.lost);
  level.drift /= found;
  for (double& r : level.rmse) r /= found;
  return level;
}

cv::Mat draw_trajectory(const DriftTrial& t, Method method, const std::string& title) {
  const auto series = [](const std::vector<Vector3>& centres, std::string name, int colour) {
    Series s{.name = std::move(name), .colour = colour};
    for (const Vector3& c : centres) {
      s.x.push_back(c.x());
      s.y.push_back(c.y());
    }
    return s;
  };
  PlotOptions plot{.title = title, .x_label = "x [m]", .y_label = "y [m]"};
  plot.equal_aspect = true;
  plot.width = plot.height = 600;
  return draw_plot({series(t.truth, "true", 7), series(t.centres[method], "estimated", 1)}, plot);
}

cv::Mat draw_levels(const std::vector<Level>& levels, double largest_noise, const std::string& title) {
  Series drift{.name = "scale drift |s - 1|", .markers = true, .dashed = true, .colour = 0, .thickness = 1};
  Series se3{.name = "RMSE, SE(3) [m]", .markers = true, .colour = 2};
  Series sim3{.name = "RMSE, Sim(3) [m]", .markers = true, .colour = 1};
  for (const Level& level : levels) {
    if (level.noise_px > largest_noise) continue;
    for (Series* s : {&drift, &se3, &sim3}) s->x.push_back(level.noise_px);
    drift.y.push_back(level.drift);
    se3.y.push_back(level.rmse[kSe3]);
    sim3.y.push_back(level.rmse[kSim3]);
  }
  PlotOptions plot{.title = title, .x_label = "image noise [px]", .y_label = "scale drift, RMSE [m]"};
  return draw_plot({drift, se3, sim3}, plot);
}

void write_levels(const std::vector<Level>& levels, Report& report) {
  std::vector<std::vector<double>> rows;
  auto list = nlohmann::json::array();
  for (const Level& l : levels) {
    rows.push_back({l.noise_px, static_cast<double>(l.trials), static_cast<double>(l.lost), l.drift,
                    l.rmse[kExplored], l.rmse[kSe3], l.rmse[kSim3], l.rmse_max[kSe3], l.rmse_max[kSim3],
                    static_cast<double>(l.better)});
    list.push_back({{"noise_px", l.noise_px},
                    {"trials", l.trials},
                    {"lost", l.lost},
                    {"scale_drift", l.drift},
                    {"rmse_explored", l.rmse[kExplored]},
                    {"rmse_se3", l.rmse[kSe3]},
                    {"rmse_sim3", l.rmse[kSim3]},
                    {"sim3_better", l.better}});
  }
  report.json()["circle"] = list;
  report.csv("fig5_5.csv",
             {"noise_px", "trials", "lost", "scale_drift", "rmse_explored", "rmse_se3", "rmse_sim3",
              "rmse_max_se3", "rmse_max_sim3", "trials_sim3_better"},
             rows);
}

void state_levels(const std::vector<Level>& levels, bool compare, Report& report) {
  int lost = 0, trials = 0, better = 0;
  bool every = true, grows = true;
  double drift = -1, exact = -1;
  std::string errors, drifts;
  for (const Level& l : levels) {
    lost += l.lost;
    trials += l.trials;
    better += l.better;
    every = every && l.rmse[kSim3] < l.rmse[kSe3];
    grows = grows && l.drift > drift;
    drift = l.drift;
    if (l.noise_px == 0) exact = l.rmse_max[kSim3];
    errors +=
        text("%s%.1f px %.3g/%.3g", errors.empty() ? "" : ", ", l.noise_px, l.rmse[kSim3], l.rmse[kSe3]);
    drifts += text("%s%.3g", drifts.empty() ? "" : ", ", l.drift);
  }
  report.state("thesis 5.4", "every trial explores the whole circle and closes it",
               text("%d of %d trials", trials - lost, trials), lost == 0);
  if (compare)
    report.state("thesis fig. 5.5 (d)", "Sim(3) has a lower mean RMSE than SE(3) at every noise level",
                 "Sim(3)/SE(3) in m: " + errors + text("; better in %d of %d trials", better, trials), every);
  report.state("thesis fig. 5.5 (d)", "scale drift grows with the image noise", "mean |s - 1|: " + drifts,
               grows);
  if (exact >= 0) {
    report.state("simulation", "without noise the circle is solved exactly (1 mm)",
                 text("largest RMSE %.1e m", exact), exact < 1e-3);
  }
}

}  // namespace

void circle_experiment(const ScaleDriftOptions& options, Report& report) {
  const auto trials = static_cast<std::size_t>(options.trials);
  std::vector<std::vector<DriftTrial>> results(options.noise_px.size(), std::vector<DriftTrial>(trials));
  tbb::parallel_for(std::size_t{0}, options.noise_px.size() * trials, [&](std::size_t task) {
    const std::size_t level = task / trials, trial = task % trials;
    const unsigned seed = options.seed + static_cast<unsigned>(trial);  // the same scenes at every level
    const Scene scene = circle_scene(options.circle_radius, seed);
    const LoopSearch search{0, 10, static_cast<int>(scene.T_c_w.size()) - 1};
    results[level][trial] = run_trial(scene, options.noise_px[level], 1000 + seed, {search});
  });
  std::vector<Level> levels;
  for (std::size_t i = 0; i < results.size(); ++i)
    levels.push_back(summarise(options.noise_px[i], results[i]));
  write_levels(levels, report);
  state_levels(levels, options.compare, report);
  const double top = *std::max_element(options.noise_px.begin(), options.noise_px.end());
  write_png(
      report.file("fig5_5_rmse.png"),
      tile({draw_levels(levels, top, "fig. 5.5 (d)"), draw_levels(levels, top / 2, "fig. 5.5 (e)")}, 2));
  // The figure shows 1 px; else the largest level.
  const auto shown = std::find(options.noise_px.begin(), options.noise_px.end(), 1.0);
  const std::size_t level = shown == options.noise_px.end()
                                ? options.noise_px.size() - 1
                                : static_cast<std::size_t>(shown - options.noise_px.begin());
  const DriftTrial& t = results[level].front();
  if (!t.ok) return;
  const std::string noise = text(", %.1f px", options.noise_px[level]);
  write_png(report.file("fig5_5_circle.png"), tile({draw_trajectory(t, kExplored, "(a) explored" + noise),
                                                    draw_trajectory(t, kSe3, "(b) SE(3)" + noise),
                                                    draw_trajectory(t, kSim3, "(c) Sim(3)" + noise)},
                                                   3));
}

}  // namespace twofold::bench
