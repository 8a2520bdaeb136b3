#include "estimation/focal_resection.hpp"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>

#include "estimation/observation_model.hpp"

namespace twofold {
namespace {

/// A standard deviation of 10 %: keeps the scale, at which frames are linearised, sensible while hardly
/// anything is known. One good frame knows a thousand times as much.
constexpr double kPriorInformation = 100;
constexpr int kLeastFrames = 10;  ///< fewer do not show how far they are apart

/// What one frame says of the logarithm of the scale, its pose eliminated.
struct FocalEquation {
  Vector6 coupling = Vector6::Zero();  ///< with the pose (left perturbation)
  double diagonal = 0, gradient = 0;

  void add(const ObservationModel& model, const HuberKernel& kernel, const Vector3& x,
           const MotionObservation& o) {
    const double inv_z = 1 / x.z();
    const Vector2 by_focal(model.fx * x.x() * inv_z, model.fy * x.y() * inv_z);
    const Vector2 error = by_focal + Vector2(model.cx - o.pixel.x(), model.cy - o.pixel.y());
    const Vector2 information = o.information.head<2>().cast<double>();
    const double weight = kernel.weight(error.dot(information.cwiseProduct(error)));
    const Vector2 force = weight * information.cwiseProduct(by_focal);
    const Vector3 on_x(force.x() * model.fx * inv_z, force.y() * model.fy * inv_z,
                       -force.dot(by_focal) * inv_z);
    coupling.head<3>() += on_x;
    coupling.tail<3>() += x.cross(on_x);
    diagonal += force.dot(by_focal);
    gradient += force.dot(error);
  }
};

Rig with_focal_length(double log_scale, Rig rig) {
  rig.camera.fx *= std::exp(log_scale);
  rig.camera.fy *= std::exp(log_scale);
  return rig;
}

}  // namespace

FocalResection::FocalResection(const Rig& rig, std::size_t max_observations, const MotionOnlyOptions& options)
    : rig_(rig), options_(options) {
  observations_.reserve(max_observations);
}

double FocalResection::log_scale() const {
  return weighted_sum_ / (information_ + kPriorInformation);
}

void FocalResection::add(std::span<const MotionObservation> observations, const SE3& T_c_ref) {
  const double at = log_scale();
  const Rig rig = with_focal_length(at, rig_);
  observations_.assign(observations.begin(), observations.end());
  for (MotionObservation& o : observations_) o.information.z() = 0;
  const MotionOnlyResult motion = optimise_motion(rig, observations_, T_c_ref, options_);
  if (!motion.determined) return;
  const ObservationModel model(rig);
  const HuberKernel kernel{options_.huber_sigmas};
  FocalEquation equation;
  for (const MotionObservation& o : observations_) {
    if (o.inlier) equation.add(model, kernel, motion.T_c_ref * o.x_ref, o);
  }
  // The pose has no gradient left.
  const double information =
      equation.diagonal - equation.coupling.dot(motion.information.ldlt().solve(equation.coupling));
  if (!(information > 0)) return;
  const double found = at - equation.gradient / information;
  information_ += information;
  weighted_sum_ += information * found;
  weighted_squares_ += information * found * found;
  ++frames_;
}

std::optional<FocalLengthEstimate> FocalResection::estimate() const {
  if (frames_ < kLeastFrames) return std::nullopt;
  const double mean = weighted_sum_ / information_;
  const double variance_factor =
      (weighted_squares_ - information_ * mean * mean) / (frames_ - 1);  // of a frame that errs by itself
  const double scale = std::exp(mean);
  return FocalLengthEstimate{scale, scale * std::sqrt(std::max(variance_factor, 1.0) / information_)};
}

}  // namespace twofold
