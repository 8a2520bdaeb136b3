#include "loopclosure/drift_model.hpp"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <limits>

#include "base/angles.hpp"

namespace twofold {
namespace {

constexpr int kMaxIterations = 10;  // of Gauss-Newton; three or four are usual
constexpr double kSettled = 0.1;    // of chi-square, whose bounds are tens

/// Where the steps lead with their errors.
template <class Steps>
Sim3 end_of(const Steps& steps, const Vector7& placement) {
  Sim3 S;
  for (const auto& step : steps) S = Sim3::exp(step.xi) * Sim3(step.D) * S;
  return Sim3::exp(placement) * S;
}

}  // namespace

DriftModel::DriftModel(SensorKind sensor, const DriftOptions& options) : options_(options) {
  const bool one_camera = sensor == SensorKind::kMono;
  const double turn_gain = one_camera ? options.turn_gain_of_one_camera : options.turn_gain;
  const double log_scale_gain = one_camera ? options.log_scale_gain : 0;
  gain_variance_ = Vector3(options.length_gain, turn_gain, log_scale_gain).cwiseAbs2();
  log_scale_ = one_camera ? options.log_scale : 0;
}

double DriftModel::chi2(const GraphSnapshot& graph, KeyframeId from, KeyframeId to,
                        const Sim3& S_to_from) const {
  std::vector<Step> steps = steps_between(graph, from, to);
  const double depth = graph.keyframe(to).median_depth;
  const Vector7 placement_variance =
      variance(options_.placement, options_.placement_deg, options_.placement_scale, depth);
  Vector7 placement = Vector7::Zero();
  double before = 0;
  for (int i = 0; i < kMaxIterations; ++i) {
    const double chi2 = bend(steps, placement, placement_variance, S_to_from);
    if (!std::isfinite(chi2)) break;
    if (i > 0 && std::abs(chi2 - before) < kSettled) return chi2;
    before = chi2;
  }
  return std::numeric_limits<double>::infinity();
}

double DriftModel::bend(std::vector<Step>& steps, Vector7& placement, const Vector7& placement_variance,
                        const Sim3& S_to_from) const {
  // exp(A delta) moves the end, where A_i = Ad of the way from step i to the end.
  std::vector<Matrix7> A(steps.size());
  Matrix7 covariance = placement_variance.asDiagonal();
  Matrix73 gains = Matrix73::Zero();
  Vector7 moved = placement;
  Sim3 S_end_i;
  for (std::size_t i = steps.size(); i-- > 0;) {
    A[i] = S_end_i.adjoint();
    covariance += A[i] * steps[i].variance.asDiagonal() * A[i].transpose();
    gains += A[i] * steps[i].calibration;
    moved += A[i] * steps[i].xi;
    S_end_i = S_end_i * Sim3::exp(steps[i].xi) * Sim3(steps[i].D);
  }
  covariance += gains * gain_variance_.asDiagonal() * gains.transpose();
  const Vector7 error = (S_to_from * end_of(steps, placement).inverse()).log() + moved;
  const Vector7 lambda = covariance.ldlt().solve(error);
  const Vector3 gain = gain_variance_.asDiagonal() * (gains.transpose() * lambda);
  for (std::size_t i = 0; i < steps.size(); ++i) {
    steps[i].xi = steps[i].variance.asDiagonal() * (A[i].transpose() * lambda) + steps[i].calibration * gain;
  }
  placement = placement_variance.asDiagonal() * lambda;
  return error.dot(lambda);
}

/// Keyframes so near to each other that the way between them tells nothing about drift make one step, so that
/// what a head or a car nods is no turn.
std::vector<DriftModel::Step> DriftModel::steps_between(const GraphSnapshot& graph, KeyframeId from,
                                                        KeyframeId to) const {
  const KeyframeId part = graph.part(to);
  std::vector<Step> steps;
  SE3 T_begin_w = graph.T_k_w(from);  // of the step under way
  SE3 T_before_w = T_begin_w;
  double distance = 0;
  const auto advance = [&](const SE3& T_k_w, double depth, bool last) {
    distance += depth > 0 ? (T_k_w * T_before_w.inverse()).translation().norm() / depth : 0;
    T_before_w = T_k_w;
    const SE3 D = T_k_w * T_begin_w.inverse();
    if (!last && distance < options_.step_distance && D.so3().log().norm() < options_.step_turn) return;
    steps.push_back(step(D, distance, depth));
    T_begin_w = T_k_w;
    distance = 0;
  };
  const bool forward = index(from) < index(to);
  const auto last = static_cast<std::int64_t>(index(to));
  for (auto k = static_cast<std::int64_t>(index(from)); k != last;) {
    k += forward ? 1 : -1;
    const KeyframeId id{static_cast<std::uint32_t>(k)};
    const Keyframe& keyframe = graph.keyframe(id);
    if (k == last)
      advance(graph.T_k_w(to), keyframe.median_depth, true);
    else if (!keyframe.culled() && keyframe.part == part)
      advance(keyframe.T_k_w, keyframe.median_depth, false);
  }
  return steps;
}

DriftModel::Step DriftModel::step(const SE3& D, double distance, double depth) const {
  const Vector3 turn = D.so3().log();
  const double way = distance + turn.norm();
  Step step{D, way * variance(options_.shift, options_.turn_deg, log_scale_, depth), Matrix73::Zero()};
  step.calibration.col(0).head<3>() = D.translation();
  step.calibration.col(1).segment<3>(3) = turn;
  step.calibration(6, 2) = way;
  return step;
}

Vector7 DriftModel::variance(double shift, double turn_deg, double log_scale, double depth) const {
  Vector7 deviations;
  deviations << Vector3::Constant(shift * depth), Vector3::Constant(turn_deg * kDegree), log_scale;
  return deviations.cwiseAbs2();
}

}  // namespace twofold
