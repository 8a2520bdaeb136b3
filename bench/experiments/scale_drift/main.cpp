// Experiments of "Scale drift-aware large scale monocular SLAM" (Strasdat 2012, chapter 5).
#include <tbb/global_control.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cstdio>

#include "experiments/parts.hpp"
#include "experiments/scale_drift/experiments.hpp"

namespace {

/// A few seconds: small scenes of the same density. What must hold is the mathematics: Jacobians, exact
/// solutions without noise, drift that grows with it.
void shrink(twofold::bench::ScaleDriftOptions& options) {
  options.compare = false;
  options.trials = 2;
  options.circle_radius = 3;
  options.noise_px = {0, 1};
  options.sphere_trials = 1;
  options.sphere.radius = 5;
  options.sphere_noise_px = 0;
}

}  // namespace

int main(int argc, char** argv) {
  using namespace twofold::bench;
  ScaleDriftOptions options;
  std::string out = "scale_drift_results";
  std::vector<std::string> only;
  int threads = 2;
  bool smoke = false;
  CLI::App app{"Scale drift: table 5.1, the circle of fig. 5.5, the sphere of fig. 5.6"};
  app.add_option("--samples", options.samples, "of a cell of table 5.1")->check(CLI::Range(2, 1000000));
  app.add_option("--spread", options.spread, "of a in A = exp(a)")->check(CLI::NonNegativeNumber);
  app.add_option("--step", options.step, "of the numerical Jacobian")->check(CLI::PositiveNumber);
  app.add_option("--trials", options.trials, "of a noise level of the circle")->check(CLI::Range(1, 100000));
  app.add_option("--noise", options.noise_px, "levels of the circle [px]")->check(CLI::NonNegativeNumber);
  app.add_option("--circle-radius", options.circle_radius, "[m]; 72 poses a metre")
      ->check(CLI::Range(1, 100));
  app.add_option("--sphere-trials", options.sphere_trials, "flights")->check(CLI::Range(1, 100000));
  app.add_option("--sphere-radius", options.sphere.radius, "[m]")->check(CLI::Range(1, 100));
  app.add_option("--sphere-noise", options.sphere_noise_px, "[px]")->check(CLI::NonNegativeNumber);
  app.add_option("--seed", options.seed, "of the first trial");
  app.add_option("--out", out, "folder for CSV, JSON, plots and the table");
  app.add_option("--only", only, "run these parts only: jacobian circle sphere");
  app.add_option("--threads", threads, "threads over trials")->check(CLI::PositiveNumber);
  app.add_flag("--smoke", smoke, "small scenes in seconds; fails when a statement does not hold");
  CLI11_PARSE(app, argc, argv);
  if (smoke) shrink(options);
  const Parts<ScaleDriftOptions> all = {
      {"jacobian", jacobian_experiment}, {"circle", circle_experiment}, {"sphere", sphere_experiment}};
  try {
    const tbb::global_control limit(tbb::global_control::max_allowed_parallelism,
                                    static_cast<std::size_t>(threads));
    Report report(out);
    report.json()["options"] = {{"samples", options.samples},
                                {"spread", options.spread},
                                {"step", options.step},
                                {"trials", options.trials},
                                {"circle_radius", options.circle_radius},
                                {"noise_px", options.noise_px},
                                {"sphere_trials", options.sphere_trials},
                                {"sphere_radius", options.sphere.radius},
                                {"sphere_noise_px", options.sphere_noise_px},
                                {"seed", options.seed}};
    run_parts(all, only, options, report);
    std::fputs(report.finish().c_str(), stdout);
    const auto& statements = report.statements();
    const bool hold =
        std::all_of(statements.begin(), statements.end(), [](const auto& s) { return s.holds; });
    return smoke && !hold ? 1 : 0;
  } catch (const std::exception& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return 1;
  }
}
