#include "camera/readout_estimator.hpp"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>

#include "base/check.hpp"
#include "base/option_check.hpp"
#include "geometry/small_motion.hpp"

namespace twofold {
namespace {

/// Square root of the information of a pixel that an error of depth moves by `slide` [px], over its weight
/// without one: (I + weight slide slide^T)^(-1/2).
Eigen::Matrix2d without_slide(const Vector2& slide, double weight) {
  const double squared = slide.squaredNorm();
  if (!(squared > 1e-12)) return Eigen::Matrix2d::Identity();
  const double share = 1 - 1 / std::sqrt(1 + weight * squared);
  return Eigen::Matrix2d::Identity() - (share / squared) * slide * slide.transpose();
}

}  // namespace

/// Normal equations of pose and readout, r = measured minus expected.
struct ReadoutEstimator::PairEquations {
  Matrix6 H = Matrix6::Zero();
  Vector6 g = Vector6::Zero();
  Vector6 H_r = Vector6::Zero();
  double h = 0, g_r = 0;

  void add(const Eigen::Matrix<double, 2, 6>& J, const Vector2& J_r, const Vector2& r, double weight) {
    const Eigen::Matrix<double, 2, 6> WJ = weight * J;
    H.noalias() += WJ.transpose() * J;
    g.noalias() += WJ.transpose() * r;
    H_r.noalias() += WJ.transpose() * J_r;
    h += weight * J_r.squaredNorm();
    g_r += weight * J_r.dot(r);
  }
};

std::string ReadoutOptions::invalid_reason() const {
  return OptionCheck()
      .at_least("min_points", min_points, 6)
      .above("gross_sigmas", gross_sigmas, 0)
      .above("huber_sigmas", huber_sigmas, 0)
      .at_least("min_turn_change", min_turn_change, 0)
      .above("seldom_interval", seldom_interval, 0)
      .share("max_missed_share", max_missed_share)
      .share("max_jitter", max_jitter)
      .at_least("pair_points", pair_points, 6)
      .at_least("pose_iterations", pose_iterations, 1)
      .above("nearest_share", nearest_share, 0)
      .at_least("mean_intervals", mean_intervals, 4)
      .at_least("first_guess", first_guess, 1)
      .at_least("pair_sigma", pair_sigma, 0)
      .above("pair_huber", pair_huber, 0)
      .at_least("min_pairs", min_pairs, 1)
      .above("significant_sigmas", significant_sigmas, 0)
      .at_least("finest_sigma", finest_sigma, 0)
      .above("exact_enough", exact_enough, 0)
      .at_least("pairs_to_know", pairs_to_know, 1)
      .at_least("pairs_to_give_up", pairs_to_give_up, 1)
      .reason();
}

ReadoutEstimator::ReadoutEstimator(const Rig& rig, std::size_t max_points, const ReadoutOptions& options)
    : rig_(rig), options_(options) {
  TWOFOLD_CHECK(options.invalid_reason().empty(), "readout options");
  for (SeenFrame& seen : frames_) seen.points.reserve(max_points);
  pair_.reserve(max_points);
}

/// Whether frames follow each other as they usually do; learns what is usual.
bool ReadoutEstimator::regular(std::int64_t interval_ns) {
  const double interval = 1e-9 * static_cast<double>(interval_ns);
  if (!(interval > 0)) return false;
  const bool usual = intervals_ == 0 || std::abs(interval - period_) < options_.max_jitter * period_;
  // The first interval may have been the unusual one.
  if (!usual && intervals_ < options_.mean_intervals / 4) intervals_ = 0;
  if (!usual && intervals_ > 0) return false;
  intervals_ = std::min(intervals_ + 1, options_.mean_intervals);
  period_ += (interval - period_) / intervals_;
  return usual;
}

std::vector<ReadoutPoint>* ReadoutEstimator::begin_frame(std::int64_t t_ns, const SE3& T_cur_prev) {
  const bool known = estimate_.significant && estimate_.sigma < options_.exact_enough &&
                     estimate_.pairs >= options_.pairs_to_know;
  if (known || estimate_.pairs >= options_.pairs_to_give_up) return nullptr;
  const bool follows = linked_ > 0 && regular(t_ns - frame(0).t_ns);
  linked_ = follows ? std::min(linked_ + 1, kFrames) : 1;
  newest_ = (newest_ + 1) % kFrames;
  SeenFrame& seen = frame(0);
  seen.t_ns = t_ns;
  seen.T_cur_prev = T_cur_prev;
  seen.solved = seen.usable = seen.sorted = false;
  seen.points.clear();
  return &seen.points;
}

void ReadoutEstimator::end_frame() {
  const std::size_t needed = 2 * newer_age() + 2;  // as many before the pair as after it
  if (linked_ < needed || !turn_changes()) return;
  for (std::size_t age = needed - 1; age-- > 0;) {
    if (!frame(age).solved) solve_pair(age);
    if (!frame(age).usable) return;
  }
  if (turn_changes()) add_pair();
}

/// At the frame of that age, >= 1: from the one before to the one after.
ReadoutEstimator::Velocity ReadoutEstimator::mean_velocity(std::size_t age) {
  return (frame(age).T_cur_prev.log() + frame(age - 1).T_cur_prev.log()) / (2 * period_);
}

/// Where frames are seldom, at the frame of that age, >= 2: of the cubic whose means over the four intervals
/// around it are the motions.
ReadoutEstimator::Velocity ReadoutEstimator::velocity(std::size_t age) {
  if (!seldom()) return mean_velocity(age);
  const Velocity outer = frame(age + 1).T_cur_prev.log() + frame(age - 2).T_cur_prev.log();
  return (14 * mean_velocity(age) - outer / period_) / 12;
}

/// Enough, and slowly enough for frames so far apart.
bool ReadoutEstimator::turn_changes() {
  const std::size_t now = newer_age(), before = now + 1;
  const Vector3 change = (velocity(now) - velocity(before)).tail<3>();
  if (!(change.norm() > options_.min_turn_change)) return false;
  const Vector3 of_means = (mean_velocity(now) - mean_velocity(before)).tail<3>();
  return !seldom() || (change - of_means).norm() < options_.max_missed_share * change.norm();
}

/// What a frame and the one before both see.
void ReadoutEstimator::join_points(std::size_t age) {
  const auto by_key = [](const ReadoutPoint& a, const ReadoutPoint& b) { return a.key < b.key; };
  for (SeenFrame* seen : {&frame(age), &frame(age + 1)}) {
    if (!seen->sorted) std::sort(seen->points.begin(), seen->points.end(), by_key);
    seen->sorted = true;
  }
  pair_.clear();
  const auto row = [this](const ReadoutPoint& p) { return (p.uv.y() + 0.5) / rig_.camera.height - 0.5; };
  const auto& before = frame(age + 1).points;
  auto p = before.begin();
  for (const ReadoutPoint& now : frame(age).points) {
    while (p != before.end() && p->key < now.key) ++p;
    if (p == before.end()) break;
    if (p->key != now.key) continue;
    const double sigma = std::max(p->sigma_px, now.sigma_px);
    pair_.push_back({rig_.camera.unproject(p->uv) * p->depth, now.uv, row(*p), row(now), 1 / (sigma * sigma),
                     p->depth_error});
  }
  // Keys go with the keyframes that points come from: every second, third, ... point is of all of them.
  const auto pair_points = static_cast<std::size_t>(options_.pair_points);
  const std::size_t stride = (pair_.size() + pair_points - 1) / pair_points;
  for (std::size_t n = 0; n * stride < pair_.size(); ++n) pair_[n] = pair_[n * stride];
  if (stride > 1) pair_.resize((pair_.size() + stride - 1) / stride);
}

ReadoutEstimator::PairEquations ReadoutEstimator::equations(const SE3& T_cur_prev, const Velocity& before,
                                                            const Velocity& now) const {
  const PinholeCamera& camera = rig_.camera;
  const Matrix3 R = T_cur_prev.rotation();
  PairEquations sum;
  for (const PairPoint& point : pair_) {
    const Vector3 x_prev = moved_by<2>(-point.row_prev * readout_ * before, point.x_prev);
    const Vector3 x = moved_by<2>(point.row * readout_ * now, R * x_prev + T_cur_prev.translation());
    if (!(x.z() > options_.nearest_share * point.x_prev.z())) continue;
    const double inv_z = 1 / x.z(), a = camera.fx * inv_z, c = camera.fy * inv_z;
    const double u = x.x() * inv_z, v = x.y() * inv_z;
    Vector2 r = point.uv - Vector2(camera.fx * u + camera.cx, camera.fy * v + camera.cy);
    Eigen::Matrix<double, 2, 6> J;  // of r: minus d project / d x [I, -[x]x]
    J << -a, 0, a * u, a * u * x.y(), -a * (x.z() + u * x.x()), a * x.y(),  //
        0, -c, c * v, c * (x.z() + v * x.y()), -c * v * x.x(), -c * x.x();
    const Vector3 late = point.row * (now.head<3>() + now.tail<3>().cross(x));
    const Vector3 early = point.row_prev * (before.head<3>() + before.tail<3>().cross(x_prev));
    Vector2 J_r = J.leftCols<3>() * (late - R * early);
    if (point.depth_error > 0) {
      const Vector2 slide = point.depth_error * (J.leftCols<3>() * T_cur_prev.translation());
      const Eigen::Matrix2d whitening = without_slide(slide, point.weight);
      J = whitening * J, J_r = whitening * J_r, r = whitening * r;
    }
    const double sigmas = r.norm() * std::sqrt(point.weight);
    if (sigmas > options_.gross_sigmas) continue;
    sum.add(J, J_r, r, point.weight * std::min(1.0, options_.huber_sigmas / std::max(sigmas, 1e-9)));
  }
  return sum;
}

/// The pose of a frame relative to the one before, from the points of both, at the readout known so far and
/// as the camera moved between the two before.
void ReadoutEstimator::solve_pair(std::size_t age) {
  SeenFrame& seen = frame(age);
  seen.solved = true;
  join_points(age);
  if (pair_.size() < static_cast<std::size_t>(options_.min_points)) return;
  const Velocity xi = frame(age + 1).T_cur_prev.log() / period_;
  for (int i = 0; i < options_.pose_iterations; ++i) {
    const PairEquations sum = equations(seen.T_cur_prev, xi, xi);
    const Eigen::LLT<Matrix6> llt(sum.H);
    const Vector6 step = llt.solve(-sum.g);
    if (llt.info() != Eigen::Success || !step.allFinite()) return;
    seen.T_cur_prev = SE3::exp(step) * seen.T_cur_prev;
    // A tenth of a standard deviation, whatever the unit of length; the next step is some hundred times
    // shorter.
    if (step.dot(sum.H * step) < 0.01) break;
  }
  seen.usable = true;
}

/// Two frames in the middle with their velocities.
void ReadoutEstimator::add_pair() {
  const std::size_t age = newer_age();
  join_points(age);
  const Velocity before = velocity(age + 1), now = velocity(age);
  const SE3 T_cur_prev = frame(age).T_cur_prev;
  PairEquations sum = equations(T_cur_prev, before, now);
  const Eigen::LLT<Matrix6> llt(sum.H);
  if (llt.info() != Eigen::Success) return;
  const Vector6 solved = llt.solve(sum.H_r);
  double h = sum.h - solved.dot(sum.H_r);
  const double gradient = sum.g_r - solved.dot(sum.g);
  if (!(h > 0) || !std::isfinite(h) || !std::isfinite(gradient)) return;
  const double readout = readout_ - gradient / h;
  h /= 1 + h * options_.pair_sigma * options_.pair_sigma;
  if (estimate_.pairs >= options_.first_guess) {
    h *= std::min(1.0, options_.pair_huber / (1e-9 + std::abs(readout - estimate_.seconds) * std::sqrt(h)));
  }
  const double b = h * readout;
  h_ += h, b_ += b, hh_ += h * h, hb_ += h * b, bb_ += b * b;
  ++estimate_.pairs;
  estimate_.seconds = b_ / h_;
  const double scatter = bb_ + estimate_.seconds * (estimate_.seconds * hh_ - 2 * hb_);
  estimate_.sigma = std::max(std::sqrt(std::max(scatter, 0.0)) / h_, 1 / std::sqrt(h_));
  estimate_.significant =
      estimate_.pairs >= options_.min_pairs && estimate_.seconds < (1 + options_.max_jitter) * period_ &&
      estimate_.seconds > options_.significant_sigmas * std::hypot(estimate_.sigma, options_.finest_sigma);
  if (estimate_.pairs >= options_.first_guess) readout_ = std::clamp(estimate_.seconds, 0.0, period_);
}

}  // namespace twofold
