// Consistency: normalised estimation error squared of pose and landmarks, with either choice of derivatives.
#include <tbb/parallel_for.h>

#include <Eigen/Cholesky>

#include "experiments/plot.hpp"
#include "experiments/sliding_window/experiments.hpp"
#include "experiments/sliding_window/simulation.hpp"

namespace twofold::bench {

void consistency_experiment(const SlidingWindowExperimentOptions& options, Report& report) {
  const Rig rig = landing_rig();
  const std::vector<int> windows = {1, 2, 3, 5, 10, 0};
  RunOptions run_options;
  run_options.frames = 30;
  run_options.landmarks = 40;
  run_options.overlap_axis = 1;
  run_options.step = Vector3(0.4, 0, 0.05);  // tracks of about 10 frames
  const int trials = options.nees_trials;
  const Bounds pose_bounds = nees_bounds(6, trials), landmark_bounds = nees_bounds(3, trials);
  std::vector<std::vector<double>> rows;
  for (const auto linearisation : {Linearisation::kFirstEstimate, Linearisation::kCurrent}) {
    const bool first = linearisation == Linearisation::kFirstEstimate;
    for (const int window : windows) {
      std::vector<double> pose(static_cast<std::size_t>(trials)), landmark(pose), error(pose);
      tbb::parallel_for(0, trials, [&](int trial) {
        const auto t = static_cast<std::size_t>(trial);
        const Run run = simulate(rig, run_options, 4000u + static_cast<unsigned>(trial));
        SlidingWindowOptions swf;
        swf.window = window;
        swf.linearisation = linearisation;
        swf.robust = false;
        SlidingWindowFilter filter(rig, swf);
        filter.set_first_pose(SE3(), std::nullopt);
        for (const FilterFrame& frame : run.frames) filter.step(frame);
        const auto covariances = filter.covariances();
        pose[t] =
            covariances ? pose_nees(filter.newest_T_c_w(), run.T_c_w.back(), covariances->poses.back()) : 1e9;
        error[t] = (filter.newest_T_c_w().inverse() * run.T_c_w.back()).translation().squaredNorm();
        // One landmark a trial (the one in the middle of the last frame's list), so that trials are
        // independent.
        const auto& seen = run.frames.back().observations;
        const std::int64_t id = seen[seen.size() / 2].landmark;
        for (int l = 0; l < filter.landmark_count() && covariances; ++l) {
          if (filter.landmark_id(l) != id) continue;
          const Vector3 e = filter.landmark(l) - run.landmarks[static_cast<std::size_t>(id)];
          landmark[t] = e.dot(covariances->landmarks[static_cast<std::size_t>(l)].ldlt().solve(e));
        }
      });
      double p = 0, m = 0, e = 0;
      for (std::size_t t = 0; t < pose.size(); ++t) {
        p += pose[t] / trials;
        m += landmark[t] / trials;
        e += error[t] / trials;
      }
      rows.push_back({static_cast<double>(first), static_cast<double>(window), p, m, std::sqrt(e)});
      const bool inside = pose_bounds.contains(p) && landmark_bounds.contains(m);
      const std::string name = window == 0 ? "batch" : "window " + std::to_string(window);
      const bool demanded = (window == 0 || window >= 5) && first;
      const std::string statement = text(
          "%s, %s: NEES of newest pose and of a landmark inside 95 %% bounds over %d trials%s", name.c_str(),
          first ? "first estimates" : "current estimates", trials, demanded ? "" : " (for comparison)");
      report.state(
          "consistency", statement,
          text("pose %.3f in [%.3f, %.3f], landmark %.3f in [%.3f, %.3f], RMS position error %.4f m", p,
               pose_bounds.low, pose_bounds.high, m, landmark_bounds.low, landmark_bounds.high, std::sqrt(e)),
          inside);
    }
  }
  report.csv("nees.csv", {"first_estimates", "window", "pose_nees", "landmark_nees", "rms_position_m"}, rows);
}

}  // namespace twofold::bench
