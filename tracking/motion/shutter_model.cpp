#include "tracking/motion/shutter_model.hpp"

#include <cmath>

#include "geometry/symmetric_solve.hpp"

namespace twofold {
ShutterModel::ShutterModel(const Rig& rig, const MotionModel& motion, std::size_t max_points,
                           const ShutterOptions& options)
    : rig_(rig), motion_(motion), options_(options) {
  if (!rig.readout) readout_.emplace(rig, max_points, options.readout);
}

RollingShutter ShutterModel::at(const SE3& T_c_ref, const FrameStep& step) const {
  if (rig_.readout.value_or(0) == 0) return {};
  const auto moving = velocity(T_c_ref, step);
  return moving ? RollingShutter(rig_, *moving) : RollingShutter();
}

/// As since the frame before, if there is one with a pose.
std::optional<Vector6> ShutterModel::velocity(const SE3& T_c_ref, const FrameStep& step) const {
  return step.velocity ? step.velocity : motion_.velocity_at(T_c_ref, step.frame.t_ns, step.after_loss());
}

Matrix6 ShutterModel::covariance(const Matrix6& information, const Matrix6& by_rows,
                                 const FrameStep& step) const {
  Matrix6 covariance = Matrix6::Zero();
  const auto velocity = motion_.velocity_at(step.result.T_c_ref, step.frame.t_ns, step.after_loss());
  if (!velocity || step.result.reference != motion_.reference()) return covariance;
  const Vector6 change = motion_.velocity() ? 0.5 * (*velocity - *motion_.velocity()) : *velocity;
  for (const Vector6& bent :
       {Vector6(readout_sigma() * *velocity), Vector6(rig_.readout.value_or(0) * change)}) {
    if (bent.isZero(0)) continue;
    const Vector6 pushed = solve_symmetric(information, by_rows * bent);
    covariance += 2 * pushed * pushed.transpose();  // the reference keyframe moved as well, and alike
  }
  return covariance;
}

void ShutterModel::learn(const FrameStep& step, const SearchOutcome& found, const LocalMap& local_map) {
  if (!readout_) return;
  const std::optional<SE3>& T_this_previous = motion_.since_previous();
  if (!T_this_previous) readout_->interrupt();
  std::vector<ReadoutPoint>* seen = readout_->begin_frame(step.frame.t_ns, T_this_previous.value_or(SE3()));
  if (seen == nullptr) return;
  const double depth_error = rig_.kind == SensorKind::kMono ? options_.bent_depth : 0;
  for (const SearchOutcome::Match& match : found.matches) {
    const TrackedPoint& point = local_map.points()[match.point];
    const StereoPixel& z = match.found.pixel;
    const bool measured = rig_.kind != SensorKind::kMono && has_right(z) && z.x() > z.z();
    const double depth =
        measured ? rig_.depth_from_disparity(z.x() - z.z()) : (step.result.T_c_ref * point.x_ref).z();
    // By where it was seen first, which it keeps when the map takes it over.
    const Eigen::Vector2f& uv = point.appearance->uv;
    const std::uint64_t key = std::uint64_t{index(local_map.anchor(point))} << 32U |
                              std::uint64_t(2 * uv.x() + 1) << 16U | std::uint64_t(2 * uv.y() + 1);
    seen->push_back({key, z.head<2>(), depth, rig_.sigma_px(match.found.level), depth_error});
  }
  readout_->end_frame();
  if (readout_->estimate().significant) rig_.readout = readout_->estimate().seconds;
}

/// By how much the readout that frames are tracked with may be wrong [s]; 0 where the calibration has it.
double ShutterModel::readout_sigma() const {
  if (!readout_) return 0;
  const ReadoutEstimate& estimate = readout_->estimate();
  const double prior = options_.unknown_readout * options_.unknown_readout;
  const double trust = prior / (prior + estimate.sigma * estimate.sigma);  // 0 before the first pair
  const double unused = rig_.readout ? 0 : trust * estimate.seconds;
  return std::hypot(std::sqrt(prior * (1 - trust)), unused);
}

}  // namespace twofold
