#include "estimation/motion_only.hpp"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>

#include "estimation/levenberg_marquardt.hpp"
#include "estimation/observation_model.hpp"

namespace twofold {
namespace {

constexpr int kLanes = 4;
using Lanes = Eigen::Array<double, kLanes, 1>;
using Observations = std::span<MotionObservation>;

/// A point behind the camera adds the cost of a far outlier and pulls at nothing: it can neither veto a step
/// nor be bought by one.
constexpr double kSigmasBehind = 100;

/// Four observations side by side.
struct Batch {
  Lanes x, y, z;     // point in the reference frame
  Lanes u, v, r;     // measurement; r is 0 without a right image
  Lanes wu, wv, wr;  // information
  Lanes used;        // 1 or 0

  Batch(Observations all, std::size_t first, bool inliers_only) {
    for (int lane = 0; lane < kLanes; ++lane) {
      const bool exists = first + lane < all.size();
      const MotionObservation& o = all[exists ? first + lane : first];
      x[lane] = o.x_ref.x(), y[lane] = o.x_ref.y(), z[lane] = o.x_ref.z();
      u[lane] = o.z.x(), v[lane] = o.z.y();
      r[lane] = o.information.z() == 0 ? 0.0 : o.z.z();
      wu[lane] = o.information.x(), wv[lane] = o.information.y(), wr[lane] = o.information.z();
      used[lane] = exists && (o.inlier || !inliers_only) ? 1.0 : 0.0;
    }
  }
};

/// Batch as seen from the pose under test.
struct Projection {
  Lanes x, y, z, inv_z;  // in the camera; z is 1 where the point is behind
  Lanes eu, ev, er;      // predicted minus measured
  Lanes chi2;
  Lanes front;  // 1 or 0

  Projection(const ObservationModel& m, const Matrix3& R, const Vector3& t, const Batch& b) {
    x = R(0, 0) * b.x + R(0, 1) * b.y + R(0, 2) * b.z + t.x();
    y = R(1, 0) * b.x + R(1, 1) * b.y + R(1, 2) * b.z + t.y();
    z = R(2, 0) * b.x + R(2, 1) * b.y + R(2, 2) * b.z + t.z();
    for (int lane = 0; lane < kLanes; ++lane) {
      front[lane] = z[lane] > kMinDepth ? 1.0 : 0.0;
      z[lane] = z[lane] > kMinDepth ? z[lane] : 1.0;
    }
    inv_z = z.inverse();
    eu = m.fx * x * inv_z + (m.cx - b.u);
    ev = m.fy * y * inv_z + (m.cy - b.v);
    er = m.fx * (x - m.baseline) * inv_z + (m.cx - b.r);
    chi2 = b.wu * eu.square() + b.wv * ev.square() + b.wr * er.square();
  }
};

/// Normal equations of the left perturbation, J = d z_hat / d x [I, -[x]x]  (thesis B.21), lane by lane:
/// with S = J_x^T W J_x and f = J_x^T W e they are [S, -S X; -(S X)^T, -X S X] and (f, x x f), X = [x]x.
struct NormalEquations {
  Lanes h[21];  // lower triangle, column by column
  Lanes g[6];
  Lanes cost = Lanes::Zero();
  double used = 0;

  NormalEquations() {
    for (Lanes& value : h) value.setZero();
    for (Lanes& value : g) value.setZero();
  }

  void add(const ObservationModel& m, const Batch& b, const Projection& p, double delta) {
    // Huber: with s = sqrt(chi2) and c = min(s, delta), rho = c (2 s - c) and the weight is delta / max(s,
    // delta).
    const Lanes s = p.chi2.sqrt();
    const Lanes clipped = s.min(delta);
    const double clipped_behind = std::min(kSigmasBehind, delta);
    const double behind = clipped_behind * (2 * kSigmasBehind - clipped_behind);
    cost += b.used * (p.front * clipped * (2 * s - clipped) + (1 - p.front) * behind);
    const Lanes weight = b.used * p.front * delta / s.max(delta);

    const Lanes a = m.fx * p.inv_z, c = m.fy * p.inv_z;
    const Lanes u = p.x * p.inv_z, v = p.y * p.inv_z, r = (p.x - m.baseline) * p.inv_z;
    const Lanes wu = weight * b.wu * a, wv = weight * b.wv * c, wr = weight * b.wr * a;
    const Lanes fu = wu * p.eu, fv = wv * p.ev, fr = wr * p.er;
    add_gradient(p, fu + fr, fv, -(u * fu + v * fv + r * fr));

    const Lanes auu = wu * a, cvv = wv * c, arr = wr * a;
    const Lanes s02 = -(auu * u + arr * r), s12 = -cvv * v;
    add_hessian(p, auu + arr, s02, cvv, s12, auu * u * u + cvv * v * v + arr * r * r);
  }

  void add_gradient(const Projection& p, const Lanes& f0, const Lanes& f1, const Lanes& f2) {
    g[0] += f0, g[1] += f1, g[2] += f2;
    g[3] += p.y * f2 - p.z * f1;
    g[4] += p.z * f0 - p.x * f2;
    g[5] += p.x * f1 - p.y * f0;
  }

  void add_hessian(const Projection& p, const Lanes& s00, const Lanes& s02, const Lanes& s11,
                   const Lanes& s12, const Lanes& s22) {
    // Rows of the lower left block (-S X)^T = X S: columns of S crossed from the left by x (s01 = 0).
    const Lanes m00 = p.y * s02, m01 = p.y * s12 - p.z * s11, m02 = p.y * s22 - p.z * s12;
    const Lanes m10 = p.z * s00 - p.x * s02, m11 = -p.x * s12, m12 = p.z * s02 - p.x * s22;
    const Lanes m20 = -p.y * s00, m21 = p.x * s11, m22 = p.x * s12 - p.y * s02;
    h[0] += s00, h[2] += s02, h[3] += m00, h[4] += m10, h[5] += m20;
    h[6] += s11, h[7] += s12, h[8] += m01, h[9] += m11, h[10] += m21;
    h[11] += s22, h[12] += m02, h[13] += m12, h[14] += m22;
    // Lower right block: rows of M crossed by x, -M X.
    h[15] += p.y * m02 - p.z * m01;
    h[16] += p.y * m12 - p.z * m11;
    h[17] += p.y * m22 - p.z * m21;
    h[18] += p.z * m10 - p.x * m12;
    h[19] += p.z * m20 - p.x * m22;
    h[20] += p.x * m21 - p.y * m20;
  }

  [[nodiscard]] Matrix6 hessian() const {
    Matrix6 H;
    for (int col = 0, n = 0; col < 6; ++col) {
      for (int row = col; row < 6; ++row, ++n) H(row, col) = H(col, row) = h[n].sum();
    }
    return H;
  }
  [[nodiscard]] Vector6 gradient() const {
    Vector6 result;
    for (int row = 0; row < 6; ++row) result[row] = g[row].sum();
    return result;
  }
};

/// One pass over the observations.
class MotionCost {
 public:
  MotionCost(const Rig& rig, Observations observations, double huber_px)
      : model_(rig),
        observations_(observations),
        delta_(huber_px > 0 && huber_px < kNoKernel ? huber_px : kNoKernel) {}

  [[nodiscard]] NormalEquations evaluate(const SE3& T, bool inliers_only) const {
    const Matrix3 R = T.rotation();
    NormalEquations sum;
    Lanes used = Lanes::Zero();
    for (std::size_t first = 0; first < observations_.size(); first += kLanes) {
      const Batch batch(observations_, first, inliers_only);
      const Projection projection(model_, R, T.translation(), batch);
      sum.add(model_, batch, projection, delta_);
      used += batch.used * projection.front;
    }
    sum.used = used.sum();
    return sum;
  }

  /// Sets the inlier flags; returns how many there are.
  int classify(const SE3& T, const MotionOnlyOptions& options) const {
    const Matrix3 R = T.rotation();
    int inliers = 0;
    for (std::size_t first = 0; first < observations_.size(); first += kLanes) {
      const Projection p(model_, R, T.translation(), Batch(observations_, first, false));
      for (std::size_t n = first; n < std::min(first + kLanes, observations_.size()); ++n) {
        MotionObservation& o = observations_[n];
        const double limit = o.information.z() == 0 ? options.inlier_chi2_mono : options.inlier_chi2_stereo;
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
  double delta_;
};

constexpr int kMinObservations = 3;

struct RoundResult {
  bool usable = false;
  bool converged = false;
};

/// Levenberg-Marquardt over T with the set of observations held.
RoundResult run_round(const MotionCost& cost, bool inliers_only, const MotionOnlyOptions& options, SE3& T) {
  NormalEquations current = cost.evaluate(T, inliers_only);
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
    const NormalEquations next = cost.evaluate(T_new, inliers_only);
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
  const MotionCost cost(rig, observations, options.huber_px);
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
  if (round.usable) round.usable = determines_pose(cost.evaluate(result.T_c_ref, true).hessian());
  if (!round.usable) result.T_c_ref = T_c_ref_start;
  result.converged = round.usable && round.converged;
  result.inliers = cost.classify(result.T_c_ref, options);
  const NormalEquations final_equations = cost.evaluate(result.T_c_ref, true);
  result.information = final_equations.hessian();
  result.chi2 = final_equations.cost.sum();
  return result;
}

}  // namespace twofold
