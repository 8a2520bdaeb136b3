#include "experiments/why_filter/gauss_newton_filter.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <stdexcept>

#include "base/check.hpp"
#include "base/option_check.hpp"

namespace twofold::bench {

std::string GaussNewtonFilterOptions::invalid_reason() const {
  return OptionCheck()
      .above("sigma_px", sigma_px, 0)
      .at_least("iterations", iterations, 0)
      .at_least("motion_iterations", motion_iterations, 0)
      .at_least("two_view_iterations", two_view_iterations, 1)
      .at_least("three_view_iterations", three_view_iterations, 1)
      .reason();
}

GaussNewtonFilter::GaussNewtonFilter(const Rig& rig, const GaussNewtonFilterOptions& options)
    : rig_(rig), anchors_(1), anchors_lin_(1), Lambda_(MatrixX::Zero(6, 6)) {
  set_options(options);
}

void GaussNewtonFilter::set_options(const GaussNewtonFilterOptions& options) {
  const std::string reason = options.invalid_reason();
  if (!reason.empty()) throw std::runtime_error("Gauss-Newton filter: " + reason);
  options_ = options;
}

InverseDepthFilter GaussNewtonFilter::first_estimate(const StereoPixel& z) const {
  return rig_.kind == SensorKind::kMono
             ? InverseDepthFilter::from_mono(rig_.camera, z.head<2>(), options_.sigma_px)
             : InverseDepthFilter::from_stereo(rig_, z, options_.sigma_px);
}

void GaussNewtonFilter::initialise(std::span<const PointObservation> first) {
  TWOFOLD_CHECK(rig_.kind != SensorKind::kMono, "a monocular filter starts with bootstrap()");
  anchors_.assign(1, SE3());
  anchors_lin_.assign(1, SE3());
  points_.clear();
  T_c_w_ = SE3();
  Lambda_ = MatrixX::Zero(6, 6);
  reference_ = 0;
  // The current pose is the origin itself: known, so its block holds no information to marginalise.
  add_points(first, 0);
}

bool GaussNewtonFilter::step(std::span<const std::int64_t> lost, std::span<const PointObservation> fresh,
                             std::span<const PointObservation> current) {
  const bool keep_pose = reference_ == kCurrentPose;
  if (fresh.empty() && !keep_pose) {
    marginalise_pose();
    if (!lost.empty()) marginalise_points(lost);
  } else {
    // The origin needs no second copy of itself as an anchor.
    const bool at_origin = Lambda_.bottomRightCorner<6, 6>().isZero(0);
    if (at_origin) {
      marginalise_pose();
    } else {
      pose_becomes_anchor();
      if (keep_pose) reference_ = anchor_count();
    }
    marginalise_points(lost);
    append_pose();
    const int anchor = at_origin ? 0 : anchor_count();
    add_points(fresh, anchor);
    Lambda_.conservativeResize(pose_at(), pose_at());
  }
  const std::vector<Seen> seen = match(current);
  estimate_motion(seen);
  append_pose();
  return joint_update(seen, options_.iterations);
}

std::vector<GaussNewtonFilter::Seen> GaussNewtonFilter::match(
    std::span<const PointObservation> observations) const {
  std::vector<std::pair<std::int64_t, int>> index;
  index.reserve(points_.size());
  for (int j = 0; j < point_count(); ++j) index.emplace_back(points_[static_cast<std::size_t>(j)].id, j);
  std::sort(index.begin(), index.end());
  std::vector<Seen> seen;
  for (const PointObservation& o : observations) {
    const auto found = std::lower_bound(index.begin(), index.end(), std::pair<std::int64_t, int>(o.point, 0));
    if (found != index.end() && found->first == o.point) seen.push_back({found->second, o.pixel});
  }
  return seen;
}

Matrix6 GaussNewtonFilter::pose_covariance() const {
  MatrixX unit = MatrixX::Zero(Lambda_.rows(), 6);
  unit.bottomRows<6>().setIdentity();
  return Lambda_.ldlt().solve(unit).bottomRows<6>();
}

}  // namespace twofold::bench
