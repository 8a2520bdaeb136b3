#include "experiments/sliding_window/simulation.hpp"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>

#include "geometry/absolute_orientation.hpp"

namespace twofold::bench {

Rig landing_rig() {
  Rig rig;
  const double f = 512 / std::tan(12.5 * M_PI / 180);
  rig.camera = {f, f, 511.5, 383.5, 1024, 768};
  rig.baseline = 0.1;
  return rig;
}

namespace {

bool visible(const Rig& rig, const Vector3& x_c) {
  if (x_c.z() < 0.3) return false;
  const StereoPixel z = rig.project(x_c);
  return rig.camera.contains(z.head<2>()) && rig.camera.contains(Vector2(z.z(), z.y()));
}

}  // namespace

Run simulate(const Rig& rig, const RunOptions& options, unsigned seed) {
  std::mt19937 rng(seed);
  std::normal_distribution<double> normal(0, 1);
  std::uniform_real_distribution<double> unit(0, 1);
  Run run;
  for (int j = 0; j < options.frames; ++j) {
    const Vector3 w = options.wobble * Vector3(normal(rng), normal(rng), normal(rng));
    const SE3 T_w_c(SO3::exp(w), static_cast<double>(j) * options.step);
    run.T_c_w.push_back(j == 0 ? SE3() : T_w_c.inverse());
  }
  const double half_x = options.range * 512 / rig.camera.fx, half_y = options.range * 384 / rig.camera.fy;
  const double length = options.step.x() * (options.frames - 1);
  const double views = options.overlap_axis > 0 ? (2 * half_x + length) / (2 * half_x) : 1;
  const int wanted = static_cast<int>(std::lround(options.landmarks * views));
  int tries = 0;
  while (static_cast<int>(run.landmarks.size()) < wanted && ++tries < 1000 * wanted) {
    const Vector3 x((2 * unit(rng) - 1) * half_x + (views > 1 ? unit(rng) * length : 0.0),
                    (2 * unit(rng) - 1) * half_y, options.range + options.relief * normal(rng));
    // Without overlap_axis every landmark is seen from everywhere (SWF fig. 12, 13, 17).
    const bool ends = visible(rig, run.T_c_w.front() * x) && visible(rig, run.T_c_w.back() * x);
    if (options.overlap_axis > 0 || ends) run.landmarks.push_back(x);
  }
  for (const SE3& T : run.T_c_w) {
    FilterFrame frame;
    for (std::size_t l = 0; l < run.landmarks.size(); ++l) {
      const Vector3 x_c = T * run.landmarks[l];
      if (options.overlap_axis > 0 ? !visible(rig, x_c) : x_c.z() < 0.3) continue;
      LandmarkObservation o;
      o.landmark = static_cast<std::int64_t>(l);
      o.pixel = rig.project(x_c) + options.noise_px * Vector3(normal(rng), normal(rng), normal(rng));
      o.information = Matrix3::Identity() / (options.noise_px * options.noise_px);
      frame.observations.push_back(o);
    }
    run.frames.push_back(std::move(frame));
  }
  return run;
}

double structure_error(const SlidingWindowFilter& filter, const Run& run) {
  std::vector<Vector3> truth, estimate;
  for (int l = 0; l < filter.landmark_count(); ++l) {
    truth.push_back(run.landmarks[static_cast<std::size_t>(filter.landmark_id(l))]);
    estimate.push_back(filter.landmark(l));
  }
  const auto T_truth_estimate = align_rigid(truth, estimate);
  if (!T_truth_estimate) return std::nan("");
  double sum = 0;
  for (std::size_t l = 0; l < truth.size(); ++l)
    sum += (*T_truth_estimate * estimate[l] - truth[l]).squaredNorm();
  return sum / static_cast<double>(truth.size());
}

double absolute_error(const SlidingWindowFilter& filter, const Run& run) {
  double sum = 0;
  for (int l = 0; l < filter.landmark_count(); ++l) {
    sum +=
        (filter.landmark(l) - run.landmarks[static_cast<std::size_t>(filter.landmark_id(l))]).squaredNorm();
  }
  return sum / std::max(1, filter.landmark_count());
}

double camera_relative_error(const SlidingWindowFilter& filter, const Run& run) {
  const auto frame = static_cast<std::size_t>(filter.frame_of(filter.pose_count() - 1));
  double sum = 0;
  for (const auto& o : run.frames[frame].observations) {
    const Vector3 truth = run.T_c_w[frame] * run.landmarks[static_cast<std::size_t>(o.landmark)];
    sum += (filter.newest_T_c_w() * *filter.find_landmark(o.landmark) - truth).squaredNorm();
  }
  return sum / static_cast<double>(std::max<std::size_t>(1, run.frames[frame].observations.size()));
}

double pose_nees(const SE3& estimate, const SE3& truth, const Matrix6& covariance) {
  const Vector6 e = (estimate * truth.inverse()).log();
  return e.dot(covariance.ldlt().solve(e));
}

Bounds nees_bounds(int dof, int trials) {
  const double n = static_cast<double>(dof) * trials;
  const auto quantile = [n](double z) {
    return n * std::pow(1 - 2 / (9 * n) + z * std::sqrt(2 / (9 * n)), 3);
  };
  return {quantile(-1.959964) / trials, quantile(1.959964) / trials};
}

}  // namespace twofold::bench
