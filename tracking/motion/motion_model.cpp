#include "tracking/motion/motion_model.hpp"

#include <algorithm>
#include <cmath>

namespace twofold {

void MotionModel::advance(const Placement& placement, std::int64_t t_ns, bool lost) {
  const bool goes_on = !lost && placement.reference == placement_.reference;
  velocity_ = goes_on ? velocity_at(placement.T_c_ref, t_ns, lost) : std::nullopt;
  T_this_previous_ = goes_on ? std::optional(placement.T_c_ref * placement_.T_c_ref.inverse()) : std::nullopt;
  interval_ = goes_on ? seconds_until(t_ns) : 0;
  place(placement, t_ns);
}

void MotionModel::refer_to(KeyframeId reference, const SE3& T_old_new) {
  placement_ = {reference, placement_.T_c_ref * T_old_new};
}

void MotionModel::place(const Placement& placement, std::int64_t t_ns) {
  placement_ = placement;
  t_ns_ = t_ns;
}

SE3 MotionModel::predicted_motion(std::int64_t t_ns, bool lost) const {
  if (lost) return {};
  const double seconds = seconds_until(t_ns);
  const double intervals = interval_ > 0 ? seconds / interval_ : 1;
  if (!velocity_ || std::abs(intervals - 1) < options_.jitter) return T_this_previous_.value_or(SE3());
  return coasted(t_ns).value_or(SE3());
}

SE3 MotionModel::predicted_pose(std::int64_t t_ns, bool lost) const {
  return predicted_motion(t_ns, lost) * placement_.T_c_ref;
}

std::optional<SE3> MotionModel::coasted(std::int64_t t_ns) const {
  const double seconds = seconds_until(t_ns);
  if (!velocity_ || !(seconds <= options_.coast_for)) return std::nullopt;
  return SE3::exp(seconds * *velocity_);
}

std::optional<Vector6> MotionModel::velocity_at(const SE3& T_c_ref, std::int64_t t_ns, bool lost) const {
  const double seconds = seconds_until(t_ns);
  if (lost || !(seconds > 0)) return std::nullopt;
  return (T_c_ref * placement_.T_c_ref.inverse()).log() / seconds;
}

bool MotionModel::reaches(const SE3& T_c_last, std::int64_t t_ns, bool all_the_time) const {
  if (!velocity_) return true;
  double seconds = seconds_until(t_ns);
  if (!all_the_time) seconds = std::min(options_.coast_for, seconds);
  const SE3 went_on = SE3::exp(seconds * *velocity_);
  const double off = (T_c_last.inverse().translation() - went_on.inverse().translation()).norm();
  return off <= options_.reach_slack + 0.5 * options_.max_acceleration * seconds * seconds;
}

}  // namespace twofold
