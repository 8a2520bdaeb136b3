// Start value of a new pose in the sliding window filter: fitted to the landmarks that are known already.
#include <algorithm>
#include <cmath>

#include "camera/measurement.hpp"
#include "estimation/levenberg_marquardt.hpp"
#include "estimation/robust_kernel.hpp"
#include "filters/sliding_window_filter.hpp"
#include "geometry/symmetric_solve.hpp"

namespace twofold {
namespace {

struct KnownLandmark {
  Vector3 x_l;
  StereoPixel pixel;
  Matrix3 information;
};

/// Half the robust cost of one pose T_c_l, given landmarks and where the motion predicts it.
class PoseCost {
 public:
  PoseCost(const Rig& rig, double huber, const std::vector<KnownLandmark>& landmarks, const SE3& T_predicted,
           const Matrix6& prior)
      : rig_(rig), kernel_{huber}, landmarks_(landmarks), T_predicted_(T_predicted), prior_(prior) {}

  [[nodiscard]] double at(const SE3& T_c_l) const { return evaluate(T_c_l, nullptr, nullptr); }
  /// Also the normal equations H delta = g of a step exp(delta) T_c_l.
  double linearise(const SE3& T_c_l, Matrix6& H, Vector6& g) const { return evaluate(T_c_l, &H, &g); }

 private:
  double evaluate(const SE3& T_c_l, Matrix6* H, Vector6* g) const {
    const Vector6 e = (T_c_l * T_predicted_.inverse()).log();
    double sum = 0.5 * e.dot(prior_ * e);
    if (H) *H = prior_;
    if (g) *g = -(prior_ * e);
    for (const KnownLandmark& known : landmarks_) {
      const Vector3 x_c = T_c_l * known.x_l;
      if (!in_front_of_camera(x_c)) continue;
      const Vector3 r = known.pixel - rig_.project(x_c);
      const double chi2 = r.dot(known.information * r);
      sum += 0.5 * kernel_.rho(chi2);
      if (!H) continue;
      Matrix36 J;
      const Matrix3 J_x = rig_.project_jacobian(x_c);
      J << J_x, -J_x * hat(x_c);
      const Matrix3 W = kernel_.weight(chi2) * known.information;
      *H += J.transpose() * W * J;
      *g += J.transpose() * (W * r);
    }
    return sum;
  }

  const Rig& rig_;
  HuberKernel kernel_;
  const std::vector<KnownLandmark>& landmarks_;
  SE3 T_predicted_;
  Matrix6 prior_;
};

/// Levenberg-Marquardt from T_c_l.
SE3 minimise(const PoseCost& cost, SE3 T_c_l) {
  double damping = 1e-6;
  Matrix6 H;
  Vector6 g;
  double current = cost.linearise(T_c_l, H, g);
  for (int i = 0; i < 10; ++i) {
    Matrix6 damped = H;
    damped.diagonal() *= 1 + damping;
    const Vector6 delta = solve_symmetric(damped, g);
    const SE3 T_new = SE3::exp(delta) * T_c_l;
    const double next = cost.at(T_new);
    if (!std::isfinite(next) || next > current) {
      damping = raised_damping(damping, 1e-3);
      continue;
    }
    T_c_l = T_new;
    damping *= 0.1;
    if (g.dot(delta) < 1e-4) break;
    current = cost.linearise(T_c_l, H, g);
  }
  return T_c_l;
}

}  // namespace

void SlidingWindowFilter::fit_newest_pose(const FilterFrame& frame) {
  std::vector<KnownLandmark> known;
  for (const LandmarkObservation& o : frame.observations) {
    const auto found = index_.find(o.landmark);
    if (found == index_.end() || !has_right(o.pixel)) continue;
    known.push_back({points_[static_cast<std::size_t>(found->second)], o.pixel, o.information});
  }
  if (known.size() < 3 && !frame.motion) return;
  Pose& pose = poses_.back();
  const double huber = options_.robust ? options_.huber_sigmas * std::sqrt(3.0) : 0.0;
  const Matrix6 prior = frame.motion ? frame.motion->information() : Matrix6::Zero();
  pose.T_c_l = minimise(PoseCost(rig_, huber, known, pose.T_c_l, prior), pose.T_c_l);
}

}  // namespace twofold
