#include "experiments/why_filter/pipelines.hpp"

#include <Eigen/SVD>
#include <algorithm>
#include <cmath>
#include <map>

#include "base/processor_time.hpp"
#include "estimation/motion_only.hpp"
#include "estimation/window_solver.hpp"

namespace twofold::bench {
namespace {

constexpr double kSigma = 0.5;
constexpr double kMinInverseDepth = 1e-3;  // farther points say nothing to bundle adjustment

/// Bundle adjustment pipeline over growing data; frames are pose indices of the problem.
class BaPipeline {
 public:
  BaPipeline(const Rig& rig, int iterations) {
    problem_.rig = rig;
    problem_.rig.noise.sigma_px = kSigma;
    options_.max_iterations = iterations;
    options_.huber_sigmas = 0;
    options_.relative_decrease = 1e-10;
  }

  int add_pose(const SE3& T, bool fixed) {
    problem_.poses.push_back({T, fixed});
    return static_cast<int>(problem_.poses.size()) - 1;
  }
  void add_point(std::int64_t id, int anchor, const Vector3& psi) {
    index_[id] = static_cast<int>(problem_.points.size());
    WindowProblem::Point point;
    point.anchor = anchor;
    point.psi = psi;
    problem_.points.push_back(point);
    tracks_.emplace_back();
  }
  void add_observation(int pose, const PointObservation& o) {
    const auto found = index_.find(o.point);
    if (found == index_.end()) return;
    const StereoPixelF pixel = o.pixel.cast<float>();
    tracks_[static_cast<std::size_t>(found->second)].push_back(
        {pose, pixel, problem_.rig.information(pixel, 0)});
  }

  /// Pose of a new frame from the points known so far  (eq. 4.15).
  SE3 motion_only(const SE3& start, const std::vector<PointObservation>& current) const {
    std::vector<MotionObservation> observations;
    for (const PointObservation& o : current) {
      const auto found = index_.find(o.point);
      if (found == index_.end()) continue;
      const auto& point = problem_.points[static_cast<std::size_t>(found->second)];
      const Vector3 x_w = problem_.poses[static_cast<std::size_t>(point.anchor)].T_k_w.inverse() *
                          from_inverse_depth(point.psi);
      observations.push_back(observe_point(problem_.rig, x_w, o.pixel.cast<float>(), 0));
    }
    MotionOnlyOptions options;
    options.huber_sigmas = 1e6;
    options.inlier_chi2_mono = options.inlier_chi2_stereo = 1e12;
    options.rounds = 1;
    return optimise_motion(problem_.rig, observations, start, options).T_c_ref;
  }

  double optimise() {
    problem_.observations.clear();
    for (std::size_t j = 0; j < tracks_.size(); ++j) {
      problem_.points[j].first_observation = static_cast<int>(problem_.observations.size());
      const auto& point = problem_.points[j];
      const Vector3 x_w = problem_.poses[static_cast<std::size_t>(point.anchor)].T_k_w.inverse() *
                          from_inverse_depth(point.psi);
      for (const auto& o : tracks_[j]) {  // behind a camera: no linearisation there
        if ((problem_.poses[static_cast<std::size_t>(o.pose)].T_k_w * x_w).z() > 0.05)
          problem_.observations.push_back(o);
      }
      problem_.points[j].observation_count =
          static_cast<int>(problem_.observations.size()) - problem_.points[j].first_observation;
    }
    optimise_structure(problem_, options_);
    const double start = thread_seconds();
    solver_.solve(problem_, options_);
    return thread_seconds() - start;
  }

  WindowProblem& problem() { return problem_; }

 private:
  WindowProblem problem_;
  WindowSolver solver_;
  WindowSolverOptions options_;
  std::map<std::int64_t, int> index_;
  std::vector<std::vector<WindowProblem::Observation>> tracks_;
};

GaussNewtonFilterOptions filter_options(int iterations, MotionEstimate motion) {
  GaussNewtonFilterOptions options;
  options.sigma_px = kSigma;
  options.iterations = iterations;
  options.motion = motion;
  return options;
}

}  // namespace

double thread_seconds() {
  return 1e-9 * static_cast<double>(thread_cpu_ns());
}

PipelineResult run_bundle_adjustment(const Block& block, int iterations) {
  PipelineResult result;
  double start = thread_seconds();
  const bool mono = block.rig.kind == SensorKind::kMono;
  BaPipeline ba(block.rig, iterations);
  int pose = 0;
  if (mono) {  // both pipelines start from the same bootstrap (4.5.3)
    GaussNewtonFilter filter(block.rig, filter_options(iterations, MotionEstimate::kMotionOnly));
    if (!filter.bootstrap(block.bootstrap[0], block.bootstrap[1], block.first)) return result;
    start = thread_seconds();  // the bootstrap is the same for both and not counted
    ba.add_pose(SE3(), true);
    for (int j = 0; j < filter.point_count(); ++j) {
      if (filter.psi(j).z() > kMinInverseDepth) ba.add_point(filter.point_id(j), 0, filter.psi(j));
    }
    for (const auto& o : block.bootstrap[0]) ba.add_observation(0, o);
    ba.add_pose(ba.motion_only(SE3(), block.bootstrap[1]), false);
    for (const auto& o : block.bootstrap[1]) ba.add_observation(1, o);
    pose = ba.add_pose(filter.T_c_w(), false);
    for (const auto& o : block.first) ba.add_observation(pose, o);
    ba.optimise();
  } else {
    ba.add_pose(SE3(), true);
    for (const auto& o : block.first) {
      ba.add_point(o.point, 0, InverseDepthFilter::from_stereo(block.rig, o.pixel, kSigma).psi);
      ba.add_observation(0, o);
    }
  }
  const int first_pose = pose;
  for (const Block::Step& step : block.steps) {
    const SE3 T_previous = ba.problem().poses[static_cast<std::size_t>(pose)].T_k_w;
    const SE3 T = ba.motion_only(T_previous, step.current);
    const int current = ba.add_pose(T, false);
    for (const auto& o : step.fresh) {  // a filter of its own per point between two keyframes  (3.4.4)
      InverseDepthFilter filter =
          mono ? InverseDepthFilter::from_mono(block.rig.camera, o.pixel.head<2>(), kSigma)
               : InverseDepthFilter::from_stereo(block.rig, o.pixel, kSigma);
      if (mono) {
        for (const auto& c : step.current) {
          if (c.point != o.point) continue;
          if (!filter.update(block.rig, T * T_previous.inverse(),
                             Vector3(c.pixel.x(), c.pixel.y(), Rig::kNoRight), kSigma))
            break;
        }
        if (!(filter.psi.z() > kMinInverseDepth)) continue;
      }
      ba.add_point(o.point, pose, filter.psi);
      ba.add_observation(pose, o);
    }
    for (const auto& o : step.current) ba.add_observation(current, o);
    result.joint_seconds += ba.optimise();
    pose = current;
  }
  result.T_last_first = ba.problem().poses[static_cast<std::size_t>(pose)].T_k_w *
                        ba.problem().poses[static_cast<std::size_t>(first_pose)].T_k_w.inverse();
  result.total_seconds = thread_seconds() - start;
  result.ok = result.T_last_first.log().allFinite();
  return result;
}

PipelineResult run_filter(const Block& block, int iterations, MotionEstimate motion) {
  PipelineResult result;
  GaussNewtonFilter filter(block.rig, filter_options(iterations, motion));
  if (block.rig.kind == SensorKind::kMono) {
    if (!filter.bootstrap(block.bootstrap[0], block.bootstrap[1], block.first)) return result;
  } else {
    filter.initialise(block.first);
  }
  const double start = thread_seconds();
  result.ok = true;
  for (const Block::Step& step : block.steps) {
    result.ok = filter.step(step.lost, step.fresh, step.current) && result.ok;
    result.joint_seconds += filter.joint_seconds();
  }
  result.T_last_first = filter.T_c_w() * filter.T_reference_w().inverse();
  result.total_seconds = thread_seconds() - start;
  result.ok = result.ok && result.T_last_first.log().allFinite();
  return result;
}

VectorX end_error(const Block& block, const PipelineResult& result) {
  const Vector3 truth = (block.T_c_w.back() * block.T_c_w.front().inverse()).inverse().translation();
  Vector3 estimate = result.T_last_first.inverse().translation();
  if (block.rig.kind != SensorKind::kMono) return truth - estimate;
  estimate *= truth.norm() / std::max(1e-12, estimate.norm());  // eq. 4.28
  const Eigen::JacobiSVD<Eigen::Matrix<double, 1, 3>, Eigen::FullPivHouseholderQRPreconditioner> svd(
      truth.transpose(), Eigen::ComputeFullV);
  return svd.matrixV().rightCols<2>().transpose() * (truth - estimate);
}

}  // namespace twofold::bench
