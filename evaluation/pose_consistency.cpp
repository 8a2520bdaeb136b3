#include "evaluation/pose_consistency.hpp"

#include <algorithm>
#include <utility>

#include "geometry/symmetric_solve.hpp"

namespace twofold {
namespace {

constexpr std::int64_t kSameTime = 1'000;        // [ns]
constexpr std::int64_t kFarApart = 110'000'000;  // poses between which nothing is known of the path [ns]
constexpr std::int64_t kStep = 5'000'000;        // of derivatives by time [ns]

}  // namespace

RelativeTruth::RelativeTruth(Trajectory truth, const TruthNoise& noise)
    : truth_(std::move(truth)), noise_(noise) {}

double RelativeTruth::Comparison::normalised(const Matrix6& covariance) const {
  return error.dot(solve_symmetric(covariance + of_truth, error)) / 6;
}

/// Between the true poses before and after.
std::optional<SE3> RelativeTruth::T_w_c(std::int64_t t_ns) const {
  const auto after = std::lower_bound(truth_.begin(), truth_.end(), t_ns - kSameTime,
                                      [](const TimedPose& pose, std::int64_t t) { return pose.t_ns < t; });
  if (after == truth_.end()) return std::nullopt;
  if (after->t_ns <= t_ns + kSameTime) return after->T_w_c;
  if (after == truth_.begin()) return std::nullopt;
  const TimedPose &a = *(after - 1), &b = *after;
  if (b.t_ns - a.t_ns > kFarApart) return std::nullopt;
  const double share = static_cast<double>(t_ns - a.t_ns) / static_cast<double>(b.t_ns - a.t_ns);
  return a.T_w_c * SE3::exp(share * (a.T_w_c.inverse() * b.T_w_c).log());
}

std::optional<SE3> RelativeTruth::T_c_ref(std::int64_t t_c_ns, std::int64_t t_ref_ns) const {
  const auto T_w_now = T_w_c(t_c_ns), T_w_then = T_w_c(t_ref_ns);
  if (!T_w_now || !T_w_then) return std::nullopt;
  return T_w_now->inverse() * *T_w_then;
}

std::optional<RelativeTruth::Comparison> RelativeTruth::compare(const SE3& estimate, std::int64_t t_c_ns,
                                                                std::int64_t t_ref_ns) const {
  const auto truth = T_c_ref(t_c_ns, t_ref_ns);
  if (!truth) return std::nullopt;
  Comparison comparison{(estimate * truth->inverse()).log(), Matrix6::Zero()};
  // Both poses err. Turning the world's axes or the camera's does not change what errs alike in all
  // directions; the turn of the earlier pose moves the later one by at most the way between them, which is
  // short.
  Matrix6& of_truth = comparison.of_truth;
  of_truth.diagonal().head<3>().setConstant(2 * noise_.position * noise_.position);
  of_truth.diagonal().tail<3>().setConstant(2 * noise_.rotation * noise_.rotation);
  const auto add_clock = [&](const std::optional<SE3>& late, const std::optional<SE3>& early) {
    if (!late || !early) return;
    const Vector6 moved = noise_.clock / (2e-9 * kStep) * (*late * early->inverse()).log();
    of_truth += moved * moved.transpose();
  };
  if (noise_.clock > 0) {
    add_clock(T_c_ref(t_c_ns + kStep, t_ref_ns), T_c_ref(t_c_ns - kStep, t_ref_ns));
    add_clock(T_c_ref(t_c_ns, t_ref_ns + kStep), T_c_ref(t_c_ns, t_ref_ns - kStep));
  }
  return comparison;
}

}  // namespace twofold
