// Figures 4.6 - 4.9, 4.12, 4.13: accuracy and cost of BA-SLAM and filter-SLAM in four settings.
#include <tbb/parallel_for.h>

#include <Eigen/LU>
#include <algorithm>
#include <cmath>

#include "experiments/why_filter/experiments.hpp"
#include "experiments/why_filter/monte_carlo.hpp"
#include "experiments/why_filter/pipelines.hpp"

namespace twofold::bench {
namespace {

Cell summarise(const std::vector<VectorX>& errors, const std::vector<PipelineResult>& results,
               double motion) {
  Cell cell;
  cell.trials = static_cast<int>(errors.size());
  const Eigen::Index dim = errors.front().size();
  VectorX mean = VectorX::Zero(dim);
  MatrixX second = MatrixX::Zero(dim, dim);
  int finite = 0;
  for (std::size_t t = 0; t < errors.size(); ++t) {
    cell.joint += results[t].joint_seconds / cell.trials;
    cell.total += results[t].total_seconds / cell.trials;
    const bool good = results[t].ok && errors[t].allFinite();
    cell.failures += !good || errors[t].norm() > 0.5 * motion;
    if (!good) continue;
    ++finite;
    mean += errors[t];
    second += errors[t] * errors[t].transpose();
  }
  if (finite < 2) return cell;
  mean /= finite;
  cell.rmse = std::sqrt(second.trace() / finite);
  const MatrixX covariance = (second - finite * mean * mean.transpose()) / (finite - 1);
  cell.log2_det = std::log2(covariance.determinant());
  return cell;
}

/// The filter, which is dear, runs in fewer trials than bundle adjustment, on the same scenes and noise.
/// Their errors hardly differ, so that the difference in those trials, added to what bundle adjustment shows
/// in all, is a much better estimate than the filter's few trials alone (control variate).
void carry_over(const Cell& ba_all, const Cell& ba_same, Cell& filter) {
  filter.rmse *= ba_all.rmse / ba_same.rmse;
  filter.log2_det += ba_all.log2_det - ba_same.log2_det;
}

void run_cell(Setting setting, SensorKind kind, int frames, int points, const WhyFilterOptions& options,
              Grid (&grids)[2]) {
  const int steps = iterations(setting);
  const double flops = frames * (steps + 1.0) * std::pow(3.0 * points + 60, 3) / 3;
  const double seconds = flops / 2e10 * (kind == SensorKind::kMono ? 3 : 1);
  const int most = std::max(options.trials, options.ba_trials);
  const int filter_trials = std::clamp(static_cast<int>(options.cell_seconds / seconds),
                                       std::min(options.min_trials, options.trials), options.trials);
  std::vector<VectorX> errors[2];
  std::vector<PipelineResult> results[2];
  for (const int method : {kBa, kFilter}) {
    errors[method].resize(static_cast<std::size_t>(method == kBa ? most : filter_trials));
    results[method].resize(errors[method].size());
  }
  double motion = 0;
  tbb::parallel_for(0, most, [&](int trial) {
    const auto t = static_cast<std::size_t>(trial);
    const Block block = simulate_block(setting, kind, frames, points, 7000u + static_cast<unsigned>(trial));
    // 4.6.3: monocular filters take account of the map's uncertainty, in the approximate version.
    const MotionEstimate estimate =
        kind == SensorKind::kMono ? MotionEstimate::kMapPriorOnce : MotionEstimate::kMotionOnly;
    results[kBa][t] = run_bundle_adjustment(block, steps);
    errors[kBa][t] = end_error(block, results[kBa][t]);
    if (trial == 0) motion = (block.T_c_w.back() * block.T_c_w.front().inverse()).translation().norm();
    if (trial >= filter_trials) return;
    results[kFilter][t] = run_filter(block, steps, estimate);
    errors[kFilter][t] = end_error(block, results[kFilter][t]);
  });
  const std::pair<int, int> at{frames, points};
  for (const int method : {kBa, kFilter})
    grids[method][at] = summarise(errors[method], results[method], motion);
  errors[kBa].resize(static_cast<std::size_t>(filter_trials));
  carry_over(grids[kBa][at], summarise(errors[kBa], results[kBa], motion), grids[kFilter][at]);
}

}  // namespace

void monte_carlo_experiment(const WhyFilterOptions& options, Report& report) {
  std::vector<Case> cases;
  for (const auto setting :
       {Setting::kSideways, Setting::kSidewaysPartial, Setting::kSidewaysRotation, Setting::kSharpTurn}) {
    const auto& wanted = options.settings;
    if (std::find(wanted.begin(), wanted.end(), setting_name(setting)) == wanted.end()) continue;
    for (const auto kind : {SensorKind::kStereo, SensorKind::kMono}) {
      Case c{setting, kind, {}, {}};
      for (const int frames : frame_counts(setting)) {
        for (const int points : {15, 30, 60, 120, 240})
          run_cell(setting, kind, frames, points, options, c.grids);
      }
      if (options.large_n && setting == Setting::kSideways)
        run_cell(setting, kind, frame_counts(setting).front(), 480, options, c.grids);
      c.find_base();
      write_case(c, report);
      plot_case(c, report);
      cases.push_back(std::move(c));
    }
  }
  state_results(cases, report);
}

}  // namespace twofold::bench
