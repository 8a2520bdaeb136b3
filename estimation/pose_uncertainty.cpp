#include "estimation/pose_uncertainty.hpp"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <limits>

#include "base/option_check.hpp"
#include "estimation/observation_model.hpp"
#include "estimation/robust_kernel.hpp"
#include "geometry/so3.hpp"
#include "geometry/symmetric_solve.hpp"

namespace twofold {
namespace {

constexpr int kPoseDimensions = 6;

void smooth(std::optional<double>& mean, double newest, double share) {
  if (!std::isfinite(newest)) return;
  mean = mean ? *mean + share * (newest - *mean) : newest;
}

Vector6 wrench(const Vector3& force, const Vector3& x) {
  Vector6 result;
  result << force, x.cross(force);
  return result;
}

/// A^T S A, A = [I, -hat(x)]: S about a point, as information about the pose that it is seen from.
Matrix6 about_pose(const ObservationTerms& terms, const Vector3& x) {
  Matrix3 S;
  S << terms.s00, 0, terms.s02, 0, terms.s11, terms.s12, terms.s02, terms.s12, terms.s22;
  const Matrix3 X = hat(x), B = -S * X;
  Matrix6 result;
  result << S, B, B.transpose(), X * B;
  return result;
}

}  // namespace

std::string PoseUncertaintyOptions::invalid_reason() const {
  return OptionCheck()
      .share("newest_regions", newest_regions)
      .share("newest_split", newest_split)
      .within("of_frame", of_frame, 0, 1)
      .reason();
}

void PoseUncertainty::update(std::span<const MotionObservation> observations, const MotionOnlyResult& motion,
                             const MotionOnlyOptions& options, bool all_agree) {
  const ObservationModel model(rig_);
  const HuberKernel kernel{options.huber_sigmas};
  const Matrix3 R = motion.T_c_ref.rotation();
  sums_.clear();
  for (const MotionObservation& o : observations) {
    if (!o.inlier) continue;
    const Vector3 x = R * o.x_ref + motion.T_c_ref.translation();
    if (!(x.z() > kSolverMinDepth)) continue;
    const ObservationTerms terms = model.linearise(x, o.pixel, o.information, kernel);
    sums_.add(o.pixel.head<2>(), about_pose(terms, x), wrench(terms.force, x));
  }
  of_frame_.reset();
  if (!all_agree) return;
  if (const auto factor = sums_.variance_factor(motion.information))
    smooth(regions_, *factor, options_.newest_regions);
  of_frame_ = sums_.jackknife(motion.information);
}

void PoseUncertainty::add_split(double factor) {
  smooth(split_, factor, options_.newest_split);
}

Matrix6 PoseUncertainty::covariance(const Matrix6& information) const {
  Matrix6 usual = variance_factor() * inverse_symmetric(information);
  if (!of_frame_ || !regions_) return usual;
  // What splits show and regions do not is missing in the frame's own part by the same factor.
  const double hidden = variance_factor() / std::max(*regions_, std::numeric_limits<double>::min());
  return (1 - options_.of_frame) * usual + options_.of_frame * hidden * *of_frame_;
}

std::optional<double> split_factor(const Matrix6& information_of_all, const Matrix6& information_of_some,
                                   const Vector6& apart) {
  // (C_some - C_all)^-1 = H_some + H_some (H_all - H_some)^-1 H_some
  const Eigen::LLT<Matrix6> of_others(information_of_all - information_of_some);
  if (of_others.info() != Eigen::Success) return std::nullopt;
  const Vector6 force = information_of_some * apart;
  return (apart.dot(force) + of_others.matrixL().solve(force).squaredNorm()) / kPoseDimensions;
}

}  // namespace twofold
