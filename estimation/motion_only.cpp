#include "estimation/motion_only.hpp"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>

#include "camera/measurement.hpp"
#include "estimation/levenberg_marquardt.hpp"
#include "estimation/motion_equations.hpp"

namespace twofold {
namespace {

using Observations = std::span<MotionObservation>;

/// One pass over the observations.
class MotionCost {
 public:
  MotionCost(const Rig& rig, Observations observations, double huber_sigmas)
      : model_(rig),
        observations_(observations),
        kernel_{huber_sigmas > 0 && huber_sigmas < kNoKernel ? huber_sigmas : kNoKernel} {}

  [[nodiscard]] MotionEquations evaluate(const SE3& T, bool inliers_only) const {
    const Matrix3 R = T.rotation();
    MotionEquations sum;
    ObservationLanes used = ObservationLanes::Zero();
    for (std::size_t first = 0; first < observations_.size(); first += kObservationLanes) {
      const ObservationBatch batch(observations_, first, inliers_only);
      const BatchProjection projection(model_, R, T.translation(), batch);
      sum.add(model_, batch, projection, kernel_);
      used += batch.used * projection.front;
    }
    sum.used = used.sum();
    return sum;
  }

  /// Sets the inlier flags; returns how many there are.
  int classify(const SE3& T, const MotionOnlyOptions& options) const {
    const Matrix3 R = T.rotation();
    int inliers = 0;
    for (std::size_t first = 0; first < observations_.size(); first += kObservationLanes) {
      const BatchProjection p(model_, R, T.translation(), ObservationBatch(observations_, first, false));
      for (std::size_t n = first; n < std::min(first + kObservationLanes, observations_.size()); ++n) {
        MotionObservation& o = observations_[n];
        const double limit =
            weighs_right(o.information) ? options.inlier_chi2_stereo : options.inlier_chi2_mono;
        o.inlier = p.front[n - first] > 0 && p.chi2[n - first] <= limit;
        inliers += o.inlier;
      }
    }
    return inliers;
  }

 private:
  static constexpr double kNoKernel = 1e100;  // as good as infinite, and its square is still a number
  ObservationModel model_;
  Observations observations_;
  HuberKernel kernel_;
};

constexpr int kMinObservations = 3;

struct RoundResult {
  bool usable = false;
  bool converged = false;
};

/// Levenberg-Marquardt over T with the set of observations fixed.
RoundResult run_round(const MotionCost& cost, bool inliers_only, const MotionOnlyOptions& options, SE3& T) {
  MotionEquations current = cost.evaluate(T, inliers_only);
  if (current.used < kMinObservations) return {};
  LevenbergMarquardtDamping damping(1e-6);
  bool accepted_any = false;
  for (int pass = 1; pass < options.max_iterations; ++pass) {
    const Matrix6 H = current.hessian();
    const Vector6 g = current.gradient();
    const Vector6 D = H.diagonal();
    if (!(D.minCoeff() > 0)) return {};
    Matrix6 damped = H;
    damped.diagonal() += damping.lambda() * D;
    const Eigen::LLT<Matrix6> llt(damped);
    if (llt.info() != Eigen::Success) return {};
    const Vector6 step = llt.solve(-g);
    if (!step.allFinite()) return {};
    if (step.norm() < options.stop_step) return {true, true};

    const SE3 T_new = SE3::exp(step) * T;
    const MotionEquations next = cost.evaluate(T_new, inliers_only);
    const double decrease = current.cost.sum() - next.cost.sum();
    const double predicted = -g.dot(step) + damping.lambda() * step.dot(D.cwiseProduct(step));
    // At the minimum rounding decides the sign of the decrease.
    if (std::abs(decrease) <= 1e-12 * current.cost.sum() && predicted <= 1e-9 * current.cost.sum()) {
      return {true, true};
    }
    if (decrease > 0) {
      T = T_new;
      current = next;
      damping.accept(decrease / predicted);
      accepted_any = true;
    } else {
      damping.reject();
    }
  }
  return {accepted_any, false};
}

/// Do the observations determine all six directions? Pivots of the information scaled to a unit diagonal.
bool determines_pose(const Matrix6& information) {
  const Vector6 d = information.diagonal();
  if (!(d.minCoeff() > 0)) return false;
  const Vector6 scale = d.cwiseSqrt().cwiseInverse();
  const Eigen::LLT<Matrix6> llt(scale.asDiagonal() * information * scale.asDiagonal());
  constexpr double kSmallestPivot = 1e-5;  // of the root: 1e-10 of the matrix, rounding leaves 1e-16
  return llt.info() == Eigen::Success && llt.matrixL().toDenseMatrix().diagonal().minCoeff() > kSmallestPivot;
}

}  // namespace

MotionOnlyResult optimise_motion(const Rig& rig, std::span<MotionObservation> observations,
                                 const SE3& T_c_ref_start, const MotionOnlyOptions& options) {
  const MotionCost cost(rig, observations, options.huber_sigmas);
  MotionOnlyResult result;
  result.T_c_ref = T_c_ref_start;
  RoundResult round;
  for (int n = 0; n < options.rounds; ++n) {
    round = run_round(cost, n > 0, options, result.T_c_ref);
    if (!round.usable) break;
    result.inliers = cost.classify(result.T_c_ref, options);
    if (result.inliers < kMinObservations) round = {};
    if (!round.usable) break;
  }
  // The last round's flags are those of its pose.
  const auto judge = [&] {
    const MotionEquations equations = cost.evaluate(result.T_c_ref, true);
    result.information = equations.hessian();
    result.chi2 = equations.cost.sum();
  };
  if (round.usable) judge();
  round.usable = round.usable && determines_pose(result.information);
  if (!round.usable) {
    result.T_c_ref = T_c_ref_start;
    result.inliers = cost.classify(result.T_c_ref, options);
    judge();
  }
  result.determined = round.usable;
  result.converged = round.usable && round.converged;
  return result;
}

int classify_observations(const Rig& rig, std::span<MotionObservation> observations, const SE3& T_c_ref,
                          const MotionOnlyOptions& options) {
  return MotionCost(rig, observations, options.huber_sigmas).classify(T_c_ref, options);
}

}  // namespace twofold
