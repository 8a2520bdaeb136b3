// Figure 5.6: an aircraft with a camera looking down flies over a sphere; ten loops are closed at once.
#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "experiments/plot.hpp"
#include "experiments/scale_drift/experiments.hpp"
#include "experiments/scale_drift/trial.hpp"

namespace twofold::bench {
namespace {

constexpr double kPi = 3.14159265358979323846;

constexpr double kNear = 0.5;  ///< of two frames that may close a loop [m]
constexpr int kGap = 20;       ///< least number of frames between them

/// A closure for every time the flight comes near a place passed earlier, at the frame that comes nearest.
std::vector<LoopSearch> sphere_searches(const Scene& scene) {
  const std::vector<Vector3> centres = camera_centres(scene.T_c_w);
  std::vector<LoopSearch> searches;
  double nearest = kNear;
  for (int j = kGap; j < static_cast<int>(centres.size()); ++j) {
    double distance = kNear;
    int i = -1;
    for (int k = 0; k + kGap <= j; ++k) {
      const double d = (centres[static_cast<std::size_t>(j)] - centres[static_cast<std::size_t>(k)]).norm();
      if (d < distance) {
        distance = d;
        i = k;
      }
    }
    const bool passing = !searches.empty() && nearest < kNear;  // still near the place of the search before
    if (i >= 0 && distance < nearest) {
      const LoopSearch search{i, i + 1, j};
      if (passing)
        searches.back() = search;
      else
        searches.push_back(search);
    }
    nearest = i >= 0 ? std::min(nearest, distance) : kNear;
  }
  return searches;
}

/// Seen from the side and a little from above.
Vector2 view(const Vector3& x) {
  constexpr double kTilt = 0.35;
  return {x.y(), x.z() * std::cos(kTilt) - x.x() * std::sin(kTilt)};
}

cv::Mat draw_flight(const DriftTrial& t, const std::vector<Vector3>& centres, const std::string& title,
                    bool loops) {
  const auto series = [](const std::vector<Vector3>& way, int colour) {
    Series s{.colour = colour, .thickness = 1};
    for (const Vector3& c : way) {
      s.x.push_back(view(c).x());
      s.y.push_back(view(c).y());
    }
    return s;
  };
  std::vector<Series> all = {series(t.truth, 7), series(centres, 1)};
  all[0].name = "true";
  all[1].name = "estimated";
  for (const LoopConstraint& loop : t.loops) {
    if (!loops) break;
    all.push_back(
        series({centres[static_cast<std::size_t>(loop.i)], centres[static_cast<std::size_t>(loop.j)]}, 2));
    all.back().thickness = 3;
  }
  if (loops) all[2].name = "loop closures";
  PlotOptions plot{.title = title, .x_label = "[m]", .y_label = "[m]"};
  plot.equal_aspect = true;
  plot.width = plot.height = 600;
  return draw_plot(all, plot);
}

void write_trials(const std::vector<DriftTrial>& trials, Report& report) {
  std::vector<std::vector<double>> rows;
  auto list = nlohmann::json::array();
  for (const DriftTrial& t : trials) {
    double least = 1, most = 1;
    for (const LoopConstraint& loop : t.loops) {
      least = std::min(least, loop.S_j_i.scale());
      most = std::max(most, loop.S_j_i.scale());
    }
    rows.push_back({static_cast<double>(t.ok), static_cast<double>(t.truth.size()),
                    static_cast<double>(t.loops.size()), least, most, t.rmse_centre[kExplored],
                    t.rmse_centre[kSe3], t.rmse_centre[kSim3], t.rmse[kExplored], t.rmse[kSe3],
                    t.rmse[kSim3]});
    list.push_back({{"ok", t.ok},
                    {"frames", t.truth.size()},
                    {"loops", t.loops.size()},
                    {"loop_scale", {least, most}},
                    {"rmse_explored", t.rmse_centre[kExplored]},
                    {"rmse_se3", t.rmse_centre[kSe3]},
                    {"rmse_sim3", t.rmse_centre[kSim3]},
                    {"rmse_se3_from_first", t.rmse[kSe3]},
                    {"rmse_sim3_from_first", t.rmse[kSim3]}});
  }
  report.json()["sphere"] = list;
  report.csv("fig5_6.csv",
             {"ok", "frames", "loops", "least loop scale", "most", "rmse_explored", "rmse_se3", "rmse_sim3",
              "rmse_explored_from_first", "rmse_se3_from_first", "rmse_sim3_from_first"},
             rows);
}

void state_trials(const std::vector<DriftTrial>& trials, const ScaleDriftOptions& options, Report& report) {
  int found = 0, ten = 0, better = 0;
  std::array<double, 3> rmse{}, from_first{};
  double least = std::numeric_limits<double>::infinity(), most = 0;
  for (const DriftTrial& t : trials) {
    if (!t.ok) continue;
    ++found;
    ten += t.loops.size() == 10;
    for (const Method m : {kExplored, kSe3, kSim3}) {
      rmse[m] += t.rmse_centre[m];
      from_first[m] += t.rmse[m];
    }
    const double ratio = t.rmse_centre[kSe3] / t.rmse_centre[kSim3];
    least = std::min(least, ratio);
    most = std::max(most, ratio);
    better += ratio > 1 && t.rmse[kSim3] < t.rmse[kSe3];
  }
  for (const Method m : {kExplored, kSe3, kSim3}) {
    rmse[m] /= std::max(1, found);
    from_first[m] /= std::max(1, found);
  }
  const int count = static_cast<int>(trials.size());
  report.state("thesis 5.4", "every flight is explored to its end and closes ten loops",
               text("%d of %d flights", ten, count), ten == count);
  if (options.sphere_noise_px == 0) {
    report.state("simulation", "without noise the sphere is solved exactly (1 mm)",
                 text("mean RMSE %.1e m", rmse[kSim3]), found > 0 && rmse[kSim3] < 1e-3);
  }
  if (!options.compare) return;
  report.state("thesis fig. 5.6", "Sim(3) has a lower RMSE than SE(3)",
               text("in %d of %d flights; explored %.3f m", better, count, rmse[kExplored]), better == count);
  report.state("thesis fig. 5.6", "the mean RMSE of Sim(3) is at least 5 times below SE(3)'s (thesis: 6.7)",
               text("%.3f against %.3f m, ratio %.2f; ratios of the flights %.2f to %.2f; scaled about the "
                    "first pose instead %.3f against %.3f m, ratio %.2f",
                    rmse[kSim3], rmse[kSe3], rmse[kSe3] / rmse[kSim3], least, most, from_first[kSim3],
                    from_first[kSe3], from_first[kSe3] / from_first[kSim3]),
               found > 0 && rmse[kSe3] >= 5 * rmse[kSim3]);
}

}  // namespace

void sphere_experiment(const ScaleDriftOptions& options, Report& report) {
  std::vector<DriftTrial> trials(static_cast<std::size_t>(options.sphere_trials));
  tbb::parallel_for(std::size_t{0}, trials.size(), [&](std::size_t trial) {
    const unsigned seed = options.seed + static_cast<unsigned>(trial);
    const Scene scene = sphere_scene(options.sphere, seed);
    trials[trial] = run_trial(scene, options.sphere_noise_px, 1000 + seed, sphere_searches(scene));
  });
  write_trials(trials, report);
  state_trials(trials, options, report);
  const DriftTrial& t = trials.front();
  if (!t.ok) return;
  write_png(
      report.file("fig5_6_sphere.png"),
      tile({draw_flight(t, t.truth, "(a) true", false),
            draw_flight(t, t.centres[kExplored], "(b) explored", true),
            draw_flight(t, t.centres[kSe3], text("(c) SE(3), RMSE %.3f m", t.rmse_centre[kSe3]), false),
            draw_flight(t, t.centres[kSim3], text("(d) Sim(3), RMSE %.3f m", t.rmse_centre[kSim3]), false)},
           2));
}

}  // namespace twofold::bench
