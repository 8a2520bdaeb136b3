// Real data with motion-capture truth: batch, windows and deletion; six-axis errors with 3-sigma envelopes.
#include "experiments/sliding_window/starry_night.hpp"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>

#include "experiments/plot.hpp"
#include "experiments/sliding_window/experiments.hpp"
#include "experiments/sliding_window/simulation.hpp"
#include "geometry/absolute_orientation.hpp"

namespace twofold::bench {
namespace {

/// Errors log(T_v_i_estimated * T_v_i_true^-1) with their covariances, per step.
struct Track {
  std::vector<Vector6> e;
  std::vector<Matrix6> covariance;
  double map_rms = 0;      ///< landmark error in the inertial frame at the end [m]
  double map_aligned = 0;  ///< after rigid alignment [m]
  double map_nees = 0;     ///< mean over landmarks, 3 degrees of freedom each
  int landmarks = 0;
};

void push(Track& track, const StarryNight& data, std::size_t k, const SE3& T_c_i,
          const Matrix6& covariance_c) {
  const SE3 T_v_c = data.T_c_v.inverse();
  const Matrix6 ad = T_v_c.adjoint();
  track.e.push_back((T_v_c * T_c_i * data.T_v_i[k].inverse()).log());
  track.covariance.push_back(ad * covariance_c * ad.transpose());
}

void finish_map(Track& track, const StarryNight& data, SlidingWindowFilter& filter) {
  const auto covariances = filter.covariances();
  std::vector<Vector3> truth, estimate;
  for (int l = 0; l < filter.landmark_count(); ++l) {
    const Vector3 e = filter.landmark(l) - data.landmarks[static_cast<std::size_t>(filter.landmark_id(l))];
    truth.push_back(data.landmarks[static_cast<std::size_t>(filter.landmark_id(l))]);
    estimate.push_back(filter.landmark(l));
    track.map_rms += e.squaredNorm();
    if (covariances)
      track.map_nees += e.dot(covariances->landmarks[static_cast<std::size_t>(l)].ldlt().solve(e));
  }
  const auto n = static_cast<double>(std::max<std::size_t>(1, truth.size()));
  track.landmarks = static_cast<int>(truth.size());
  track.map_rms = std::sqrt(track.map_rms / n);
  track.map_nees /= n;
  if (const auto T = align_rigid(truth, estimate)) {
    for (std::size_t l = 0; l < truth.size(); ++l)
      track.map_aligned += (*T * estimate[l] - truth[l]).squaredNorm();
  }
  track.map_aligned = std::sqrt(track.map_aligned / n);
}

SlidingWindowOptions filter_options(int window, PoseRemoval removal) {
  SlidingWindowOptions options;
  options.window = window;
  options.removal = removal;
  options.keep_unseen_landmarks = true;  // the same 20 lights return again and again
  // After fifty steps without any light (1464 on) the first one contradicts the dead reckoning by six of its
  // standard deviations: ten Gauss-Newton steps do not settle that in a short window.
  options.max_iterations = 50;
  return options;
}

/// The first pose is known as well as the motion capture knows it.
Matrix6 first_information() {
  Vector6 sigma;
  sigma << Vector3::Constant(2e-3), Vector3::Constant(2e-3);
  return sigma.cwiseAbs2().cwiseInverse().asDiagonal();
}

Track causal(const StarryNight& data, int window, PoseRemoval removal) {
  SlidingWindowFilter filter(data.rig, filter_options(window, removal));
  filter.set_first_pose(data.T_c_v * data.T_v_i[0], first_information());
  Track track;
  for (std::size_t k = 0; k < data.frames.size(); ++k) {
    filter.step(data.frames[k]);
    const auto covariances = filter.covariances();
    push(track, data, k, filter.newest_T_c_w(),
         covariances ? covariances->poses.back() : Matrix6::Identity());
  }
  finish_map(track, data, filter);
  return track;
}

/// One estimate of all poses from all data.
Track smoothed(const StarryNight& data) {
  SlidingWindowFilter filter(data.rig, filter_options(0, PoseRemoval::kMarginalise));
  filter.set_first_pose(data.T_c_v * data.T_v_i[0], first_information());
  for (const FilterFrame& frame : data.frames) {
    filter.add(frame);
    if (filter.pose_count() % 50 == 0) filter.optimise();  // keeps the start of the next poses close
  }
  filter.optimise();
  Track track;
  const auto covariances = filter.covariances();
  for (std::size_t k = 0; k < data.frames.size(); ++k) {
    push(track, data, k, filter.T_c_w(static_cast<int>(k)),
         covariances ? covariances->poses[k] : Matrix6::Identity());
  }
  finish_map(track, data, filter);
  return track;
}

struct Summary {
  double position = 0, rotation = 0, nees = 0, inside = 0;  ///< m, rad, mean NEES / 6, share within 3 sigma
};

Summary summarise(const Track& track) {
  Summary s;
  const auto n = static_cast<double>(track.e.size());
  for (std::size_t k = 0; k < track.e.size(); ++k) {
    s.position += track.e[k].head<3>().squaredNorm() / n;
    s.rotation += track.e[k].tail<3>().squaredNorm() / n;
    s.nees += track.e[k].dot(track.covariance[k].ldlt().solve(track.e[k])) / n / 6;
    for (int i = 0; i < 6; ++i) {
      s.inside += std::abs(track.e[k][i]) < 3 * std::sqrt(track.covariance[k](i, i)) ? 1 / (6 * n) : 0.0;
    }
  }
  s.position = std::sqrt(s.position);
  s.rotation = std::sqrt(s.rotation);
  return s;
}

void plot_envelopes(const StarryNight& data, const Track& track, const std::string& name, Report& report) {
  const char* axes[6] = {"x [m]", "y [m]", "z [m]", "about x [rad]", "about y [rad]", "about z [rad]"};
  std::vector<cv::Mat> plots;
  std::vector<std::vector<double>> rows(track.e.size());
  for (std::size_t k = 0; k < rows.size(); ++k) rows[k].push_back(data.t[k]);
  for (int i = 0; i < 6; ++i) {
    Series error{.name = "error", .x = data.t, .thickness = 1}, high{.name = "3 sigma", .x = data.t},
        low{.x = data.t};
    for (std::size_t k = 0; k < track.e.size(); ++k) {
      const double sigma = std::sqrt(track.covariance[k](i, i));
      error.y.push_back(track.e[k][i]);
      high.y.push_back(3 * sigma);
      low.y.push_back(-3 * sigma);
      rows[k].insert(rows[k].end(), {track.e[k][i], sigma});
    }
    high.colour = low.colour = 3;
    error.colour = 0;
    high.thickness = low.thickness = 1;
    plots.push_back(draw_plot({high, low, error}, {.title = name + ": " + axes[i],
                                                   .x_label = "time [s]",
                                                   .y_label = "error in the vehicle frame",
                                                   .width = 800,
                                                   .height = 380}));
  }
  const std::string file = "starry_night_" + name;
  report.csv(file + ".csv", {"t", "x", "sx", "y", "sy", "z", "sz", "rx", "srx", "ry", "sry", "rz", "srz"},
             rows);
  // Columns: translation, rotation.
  write_png(report.file(file + ".png"),
            tile({plots[0], plots[3], plots[1], plots[4], plots[2], plots[5]}, 2));
}

}  // namespace

void starry_night_experiment(const SlidingWindowExperimentOptions& options, Report& report) {
  const StarryNight data = load_starry_night(options.data, options.starry_first, options.starry_steps);
  struct Case {
    std::string name;
    Track track;
  };
  std::vector<Case> cases;
  cases.push_back({"batch_smoothed", smoothed(data)});
  cases.push_back({"batch_causal", causal(data, 0, PoseRemoval::kMarginalise)});
  for (const int window : {50, 10, 5, 1}) {
    cases.push_back({"window_" + std::to_string(window), causal(data, window, PoseRemoval::kMarginalise)});
  }
  cases.push_back({"deletion_10", causal(data, 10, PoseRemoval::kDelete)});
  std::vector<Summary> summaries;
  for (const Case& c : cases) {
    plot_envelopes(data, c.track, c.name, report);
    summaries.push_back(summarise(c.track));
    const Summary& s = summaries.back();
    report.json()["starry_night"][c.name] = {
        {"rms_position_m", s.position},     {"rms_rotation_rad", s.rotation},
        {"nees_per_dof", s.nees},           {"inside_3_sigma", s.inside},
        {"map_rms_m", c.track.map_rms},     {"map_aligned_rms_m", c.track.map_aligned},
        {"map_nees", c.track.map_nees / 3}, {"landmarks", c.track.landmarks}};
    report.state("Starry Night",
                 c.name + ": errors inside their 3-sigma envelopes (at least 98 % over six axes)",
                 text("RMS position %.4f m, rotation %.4f rad; inside %.2f %%; NEES per degree of freedom "
                      "%.3f; map RMS %.4f m "
                      "(aligned %.4f m), map NEES per degree %.3f",
                      s.position, s.rotation, 100 * s.inside, s.nees, c.track.map_rms, c.track.map_aligned,
                      c.track.map_nees / 3),
                 s.inside >= 0.98);
  }
  const auto against = [&](std::size_t i) { return summaries[i].position / summaries[1].position - 1; };
  const auto against_rotation = [&](std::size_t i) {
    return summaries[i].rotation / summaries[1].rotation - 1;
  };
  report.state("Starry Night",
               "windows of 10 and 50 within 5 % of batch (RMS position and rotation, both causal)",
               text("50: %+.2f %% (rotation %+.2f %%), 10: %+.2f %% (%+.2f %%); 5: %+.2f %%, 1: %+.2f %%, "
                    "deletion %+.0f %%; "
                    "smoothed batch %+.2f %%",
                    100 * against(2), 100 * against_rotation(2), 100 * against(3), 100 * against_rotation(3),
                    100 * against(4), 100 * against(5), 100 * against(6), 100 * against(0)),
               std::max({against(2), against(3), against_rotation(2), against_rotation(3)}) < 0.05);
}

}  // namespace twofold::bench
