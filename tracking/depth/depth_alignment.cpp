#include "tracking/depth/depth_alignment.hpp"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>

#include "base/option_check.hpp"
#include "camera/measurement.hpp"
#include "estimation/robust_kernel.hpp"
#include "geometry/so3.hpp"
#include "geometry/symmetric_solve.hpp"

namespace twofold {
std::string DepthAlignmentOptions::invalid_reason() const {
  return OptionCheck()
      .nested("planes", planes.invalid_reason())
      .at_least("max_iterations", max_iterations, 1)
      .at_least("min_planes", min_planes, 6)
      .share("min_met_share", min_met_share)
      .above("kernel", kernel, 0)
      .at_least("normal_sigma", normal_sigma, 0)
      .at_least("depth_sigma", depth_sigma, 0)
      .share("max_chance_share", max_chance_share)
      .above("max_sigma_m", max_sigma_m, 0)
      .above("max_sigma_rad", max_sigma_rad, 0)
      .at_least("min_corners", min_corners, 3)
      .above("max_apart", max_apart, 0)
      .within("min_facing", min_facing, -1, 1)
      .above("corner_huber", corner_huber, 0)
      .above("max_corner_chi2", max_corner_chi2, 0)
      .at_least("max_kernel", max_kernel, kernel)
      .within("jackknife_share", jackknife_share, 0, 1)
      .above("max_deviation", max_deviation, 0)
      .above("settled_step", settled_step, 0)
      .at_least("nearly_settled_step", nearly_settled_step, settled_step)
      .at_least("first_stride", first_stride, 1)
      .reason();
}

DepthAlignment::DepthAlignment(const Rig& rig, const DepthAlignmentOptions& options)
    : rig_(rig), options_(options), current_(rig, options.planes) {
  slots_.reserve(kViews);
  for (std::size_t v = 0; v < kViews; ++v)
    slots_.emplace_back(rig, options.planes);  // a copy would lack room
}

void DepthAlignment::add_view(KeyframeId id, const cv::Mat& depth, const SE3& T_view_ref) {
  if (views_ == kViews) return;
  const auto has = [&](const ViewPlanes& view) { return view.id == id; };
  auto slot = std::find_if(slots_.begin(), slots_.end(), has);
  if (slot == slots_.end()) {  // in place of the oldest
    slot = std::min_element(slots_.begin(), slots_.end(), [](const ViewPlanes& a, const ViewPlanes& b) {
      return a.id != b.id && (a.id == kNoKeyframe || (b.id != kNoKeyframe && a.id < b.id));
    });
    slot->id = id;
    slot->planes.read(depth);
  }
  slot->T_view_ref = T_view_ref;
  order_[views_++] = static_cast<std::size_t>(slot - slots_.begin());
}

/// Residual m . x - 1: of depth, in shares of it. None when it is another surface.
std::optional<DepthAlignment::Pair> DepthAlignment::pair_up(const DepthPlanes::Plane& seen,
                                                            const DepthPlanes::Plane& plane,
                                                            const SE3& T_view_c) const {
  const Matrix3 R = T_view_c.rotation();
  const Vector3 x = R * seen.x + T_view_c.translation();
  const double residual = plane.m.dot(x) - 1;
  const Vector3 m_c = R.transpose() * plane.m;
  const double length = plane.m.norm();
  if (std::abs(residual) > options_.max_apart * length * x.norm()) return std::nullopt;
  if (m_c.dot(seen.m) < options_.min_facing * length * seen.m.norm()) return std::nullopt;
  const double of_plane = plane.sigma * x.z();
  return Pair{m_c, &plane, R, residual, of_plane * of_plane};
}

/// All views that meet a plane of the frame share its noise m, and add their own p_v: the covariance of their
/// residuals is diag(p_v^2) + m^2 1 1^T. Their lines of the Jacobian are alike, so that its inverse comes to
/// weights
///
///   w_v = p_v^-2 / (1 + m^2 sum_u p_u^-2)
///
/// (Sherman and Morrison): of many views no more is known than the frame's own reading.
void DepthAlignment::add_pairs(const DepthPlanes::Plane& seen, std::span<const Pair> pairs, const Pass& pass,
                               Equations& equations) const {
  // Planes of neighbouring cells share readings: together they are known as well as each cell's own mean.
  const double of_point = seen.sigma * seen.x.z();
  const double shared = of_point * of_point + options_.depth_sigma * options_.depth_sigma;
  double precision = 0;
  for (const Pair& pair : pairs) precision += 1 / pair.variance;
  for (const Pair& pair : pairs) {
    const double deviation = std::abs(pair.residual) / std::sqrt(pair.variance + shared);
    const double robust = 1 / (1 + deviation * deviation / (pass.kernel * pass.kernel));
    const double weight = robust / (pair.variance * (1 + shared * precision));
    Vector6 J;
    J << pair.m_c, seen.x.cross(pair.m_c);  // of minus the residual
    equations.H.noalias() += weight * J * J.transpose();
    equations.g.noalias() -= weight * pair.residual * J;
    equations.deviations += std::min(deviation, options_.max_deviation);
    equations.squares += robust * deviation * deviation;
    equations.weights += robust;
    ++equations.pairs;
    if (!pass.with_chance) continue;
    const double bent = options_.normal_sigma * options_.normal_sigma;
    const Matrix3 of_normal =
        pair.R_view_c.transpose() * pair.view->covariance * pair.R_view_c +
        bent * (pair.m_c.squaredNorm() * Matrix3::Identity() - pair.m_c * pair.m_c.transpose());
    Eigen::Matrix<double, 6, 3> A;
    A << Matrix3::Identity(), hat(seen.x);
    equations.chance.noalias() += weight * A * of_normal * A.transpose();
  }
}

DepthAlignment::Equations DepthAlignment::linearise(const SE3& T_c_ref, const Pass& pass,
                                                    RegionSums* regions) const {
  Equations equations;
  std::array<SE3, kViews> T_view_c;
  for (std::size_t v = 0; v < views_; ++v) {
    T_view_c[v] = slots_[order_[v]].T_view_ref * T_c_ref.inverse();
  }
  const std::vector<DepthPlanes::Plane>& planes = current_.planes();
  for (std::size_t i = 0; i < planes.size(); i += pass.stride) {
    const DepthPlanes::Plane& seen = planes[i];
    std::array<Pair, kViews> pairs;
    std::size_t met = 0;
    for (std::size_t v = 0; v < views_; ++v) {
      const Vector3 x = T_view_c[v] * seen.x;
      if (!in_front_of_camera(x)) continue;
      const DepthPlanes::Plane* plane = slots_[order_[v]].planes.at(rig_.camera.project(x));
      if (plane == nullptr) continue;
      if (const auto pair = pair_up(seen, *plane, T_view_c[v])) pairs[met++] = *pair;
    }
    const Matrix6 H_before = equations.H;
    const Vector6 g_before = equations.g;
    add_pairs(seen, std::span(pairs).first(met), pass, equations);
    if (regions != nullptr && met > 0)
      regions->add(rig_.camera.project(seen.x).cast<float>(), equations.H - H_before, equations.g - g_before);
    equations.met += met > 0 ? 1 : 0;
  }
  return equations;
}

void DepthAlignment::add_corners(const SE3& T_c_ref, std::span<const MotionObservation> corners,
                                 bool settling, Equations& equations, RegionSums* regions) const {
  for (const MotionObservation& corner : corners) {
    const Vector3 x = T_c_ref * corner.x_ref;
    if (!in_front_of_camera(x)) continue;
    Vector3 residual = rig_.project(x) - corner.pixel.cast<double>();
    const Vector3 information = corner.information.cast<double>();
    if (!weighs_right(information)) residual.z() = 0;  // there is no third component
    const double chi2 = residual.dot(information.cwiseProduct(residual));
    if (settling && chi2 > options_.max_corner_chi2) continue;
    const double robust = HuberKernel{options_.corner_huber}.weight(chi2);
    Eigen::Matrix<double, 3, 6> J;
    J << Matrix3::Identity(), -hat(x);
    J = rig_.project_jacobian(x) * J;
    const Eigen::Matrix<double, 6, 3> weighted = robust * J.transpose() * information.asDiagonal();
    const Matrix6 H = weighted * J;
    const Vector6 g = weighted * residual;
    equations.H += H;
    equations.g += g;
    if (regions != nullptr) regions->add(corner.pixel.head<2>(), H, g);
  }
}

/// What is known of the pose: the information without what is owed to chance; none when that leaves a
/// direction open.
std::optional<Matrix6> DepthAlignment::determined(const Equations& equations,
                                                  const Matrix6& of_corners) const {
  // Residuals larger than they should be: of the frame as a whole, the sensor errs by as much.
  const double scale = std::max(1.0, equations.squares / std::max(equations.weights, 1.0));
  const Matrix6 all = equations.H / scale + of_corners;
  const Matrix6 chance = equations.chance / scale;
  // In no direction x is x' chance x more than this share of x' all x: the difference is positive definite.
  if (Eigen::LLT<Matrix6>(options_.max_chance_share * all - chance).info() != Eigen::Success)
    return std::nullopt;
  const Matrix6 information = all - chance;
  const Eigen::LLT<Matrix6> llt(information);
  if (llt.info() != Eigen::Success) return std::nullopt;
  const Vector6 variances = llt.solve(Matrix6::Identity()).diagonal();
  const double sigma_m = std::sqrt(variances.head<3>().maxCoeff());
  const double sigma_rad = std::sqrt(variances.tail<3>().maxCoeff());
  if (!(sigma_m < options_.max_sigma_m) || !(sigma_rad < options_.max_sigma_rad)) return std::nullopt;
  return information;
}

tl::expected<DepthAlignment::Result, LostCause> DepthAlignment::align(
    const SE3& T_c_ref_start, std::span<const MotionObservation> corners) const {
  if (static_cast<int>(current_.planes().size()) < options_.min_planes || views_ == 0)
    return tl::unexpected(LostCause::kTooFewMatches);
  SE3 T_c_ref = T_c_ref_start;
  Pass pass{options_.max_kernel, static_cast<std::size_t>(options_.first_stride), false};
  if (static_cast<int>(corners.size()) < options_.min_corners) corners = {};
  for (int iteration = 0; iteration < options_.max_iterations; ++iteration) {
    Equations equations = linearise(T_c_ref, pass);
    if (equations.pairs < 6) return tl::unexpected(LostCause::kTooFewMatches);
    add_corners(T_c_ref, corners, pass.stride == 1, equations);
    equations.H.diagonal() *= 1 + 1e-9;  // a wall leaves directions open: they are judged in the end
    const Vector6 step = -solve_symmetric(equations.H, equations.g);
    if (!step.allFinite() || !(step.norm() < 1)) return tl::unexpected(LostCause::kNoStructure);
    T_c_ref = SE3::exp(step) * T_c_ref;
    if (pass.stride == 1 && step.norm() < options_.settled_step) break;
    if (step.norm() < options_.nearly_settled_step) pass.stride = 1;
    pass.kernel =
        std::clamp(2 * equations.deviations / equations.pairs, options_.kernel, options_.max_kernel);
  }
  return judge(T_c_ref, corners);
}

/// Whether a pose is to be believed, and how well it is known.
tl::expected<DepthAlignment::Result, LostCause> DepthAlignment::judge(
    const SE3& T_c_ref, std::span<const MotionObservation> corners) const {
  Result result;
  result.T_c_ref = T_c_ref;
  RegionSums regions(rig_.camera);
  const Equations depth = linearise(T_c_ref, {options_.kernel, 1, true}, &regions);
  result.met = static_cast<double>(depth.met) / static_cast<double>(current_.planes().size());
  if (result.met < options_.min_met_share) return tl::unexpected(LostCause::kTooFewMatches);
  Equations of_corners;
  add_corners(T_c_ref, corners, true, of_corners, &regions);
  const auto information = determined(depth, of_corners.H);
  if (!information) return tl::unexpected(LostCause::kNoStructure);
  result.information = *information;
  result.all = depth.H + of_corners.H;
  result.by_rows = regions.by_rows();
  const auto of_regions = regions.jackknife(result.all);
  const double factor = std::max(1.0, regions.variance_factor(result.all).value_or(1));
  const Matrix6 usual = factor * inverse_symmetric(*information);
  const double share = options_.jackknife_share;
  result.covariance = of_regions ? Matrix6(share * *of_regions + (1 - share) * usual) : usual;
  return result;
}

LostCause DepthAlignment::judge_structure() const {
  if (static_cast<int>(current_.planes().size()) < options_.min_planes) return LostCause::kTooFewMatches;
  Equations equations;
  for (const DepthPlanes::Plane& plane : current_.planes()) {
    if (const auto pair = pair_up(plane, plane, SE3()))
      add_pairs(plane, std::span(&*pair, 1), {options_.kernel, 1, true}, equations);
  }
  return determined(equations, Matrix6::Zero()) ? LostCause::kNone : LostCause::kNoStructure;
}

}  // namespace twofold
