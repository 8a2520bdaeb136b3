// Experiments of thesis 6.5.1 (Strasdat 2012): the double window against bundle adjustment over everything.
#include <tbb/global_control.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cstdio>
#include <functional>

#include "experiments/double_window/experiments.hpp"

int main(int argc, char** argv) {
  using namespace twofold;
  using namespace twofold::bench;
  DoubleWindowExperimentOptions options;
  std::string out = "double_window_results";
  std::vector<std::string> only;
  int threads = 2;
  bool full = false, smoke = false;
  CLI::App app{"Double window optimisation: figures 6.9 - 6.12"};
  app.add_option("--trials", options.trials, "Monte Carlo trials")->check(CLI::PositiveNumber);
  app.add_flag("--full", full, "ten trials, as in the thesis: about 15 minutes on two cores");
  app.add_flag("--smoke", smoke, "only shows that it runs: one trial, few keyframes");
  app.add_option("--keyframes", options.keyframes, "of the spiral")->check(CLI::Range(20, 100000));
  app.add_option("--seed", options.seed, "of the first trial");
  app.add_option("--noise", options.scene.noise_px, "of a measurement [px]")->check(CLI::PositiveNumber);
  app.add_option("--sightings", options.scene.max_sightings, "points a keyframe measures at most");
  app.add_option("--density", options.scene.density, "points per square metre of the spiral's ground");
  app.add_option("--height", options.scene.height, "of the spiral's camera above the ground [m]");
  app.add_option("--step", options.scene.step, "between keyframes of the spiral [m]");
  app.add_option("--spacing", options.scene.spacing, "between the turns of the spiral [m]");
  app.add_option("--anchors", options.max_anchors,
                 "that may take places of the outer window for their points");
  app.add_option("--trans-share", options.edge.trans_share, "of an edge's ideal translational precision");
  app.add_option("--rot-share", options.edge.rot_share, "of an edge's ideal rotational precision");
  app.add_flag("--metres", options.metres, "double windows without a unit of the map's own");
  app.add_option("--length-share", options.length_share, "of what a measured edge says about its length");
  app.add_flag("--coarse-edges", options.coarse_edges,
               "stereo: eq. 6.2 for gDWO's edges as well, which are measured otherwise");
  app.add_option("--out", out, "folder for CSV, JSON, plots and the table");
  app.add_option("--only", only, "run these parts only: stereo mono double_loop");
  app.add_option("--threads", threads, "threads over trials")->check(CLI::PositiveNumber);
  CLI11_PARSE(app, argc, argv);
  if (full) options.trials = 10;
  if (smoke) {
    options.trials = 1;
    options.keyframes = 80;
  }
  using Part = std::pair<std::string, std::function<void(const DoubleWindowExperimentOptions&, Report&)>>;
  const std::vector<Part> all = {
      {"stereo", [](const auto& o, Report& r) { spiral_experiment(o, SensorKind::kStereo, r); }},
      {"mono", [](const auto& o, Report& r) { spiral_experiment(o, SensorKind::kMono, r); }},
      {"double_loop", double_loop_experiment}};
  try {
    const tbb::global_control limit(tbb::global_control::max_allowed_parallelism,
                                    static_cast<std::size_t>(threads));
    Report report(out);
    report.json()["options"] = {{"trials", options.trials},
                                {"keyframes", options.keyframes},
                                {"loop_keyframes", options.loop_keyframes},
                                {"seed", options.seed},
                                {"noise_px", options.scene.noise_px},
                                {"max_sightings", options.scene.max_sightings},
                                {"density", options.scene.density},
                                {"height", options.scene.height},
                                {"step", options.scene.step},
                                {"spacing", options.scene.spacing},
                                {"max_anchors", options.max_anchors},
                                {"trans_share", options.edge.trans_share},
                                {"rot_share", options.edge.rot_share},
                                {"length_share", options.length_share},
                                {"coarse_edges", options.coarse_edges},
                                {"metres", options.metres}};
    for (const auto& [name, experiment] : all) {
      if (!only.empty() && std::find(only.begin(), only.end(), name) == only.end()) continue;
      experiment(options, report);
      std::printf("done: %s\n", name.c_str());
      std::fflush(stdout);
    }
    std::fputs(report.finish().c_str(), stdout);
  } catch (const std::exception& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return 1;
  }
  return 0;
}
