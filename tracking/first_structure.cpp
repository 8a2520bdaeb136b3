#include "tracking/first_structure.hpp"

#include <algorithm>
#include <cmath>

#include "estimation/motion_only.hpp"
#include "filters/anchored_views.hpp"
#include "filters/inverse_depth_filter.hpp"
#include "geometry/essential_matrix.hpp"
#include "geometry/homography.hpp"
#include "geometry/inverse_depth.hpp"
#include "geometry/option_check.hpp"
#include "geometry/view_rotation.hpp"

namespace twofold {
namespace {

constexpr double kSignificant = 2;          // standard deviations
constexpr double kMostBehind = 0.1;         // share of significant depths that may have the wrong sign
constexpr double kPlaneShare = 0.9;         // explained by a homography: the scene may be a plane
constexpr double kOutlierChi2 = 9.21;       // 99 % of chi-square with 2 degrees of freedom
constexpr double kUsableDepthError = 0.25;  // of a point that joins the first map
constexpr double kDecisiveChi2 = 15;        // by which one motion must explain all better than another
constexpr int kAdjustmentSteps = 15;

std::vector<Vector3> bearings(const PinholeCamera& camera, const std::vector<Vector2>& pixels) {
  std::vector<Vector3> result;
  result.reserve(pixels.size());
  for (const Vector2& uv : pixels) result.push_back(camera.unproject(uv));
  return result;
}

double median(std::vector<double> values) {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

double median_flow(const CornerViews& views) {
  std::vector<double> flow;
  for (std::size_t i = 0; i < views.first.size(); ++i)
    flow.push_back((views.last[i] - views.first[i]).norm());
  return median(std::move(flow));
}

/// Size of the intersection of two ascending lists.
std::size_t common(const std::vector<int>& a, const std::vector<int>& b) {
  std::vector<int> both;
  std::set_intersection(a.begin(), a.end(), b.begin(), b.end(), std::back_inserter(both));
  return both.size();
}

/// Everything about one attempt to start.
class Attempt {
 public:
  Attempt(const Rig& rig, const CornerViews& views, const FirstStructureOptions& options)
      : rig_(rig),
        views_(views),
        options_(options),
        first_(bearings(rig.camera, views.first)),
        last_(bearings(rig.camera, views.last)) {
    rig_.kind = SensorKind::kMono;
    rig_.baseline = 0;
  }

  tl::expected<FirstStructure, LostCause> run() {
    if (static_cast<int>(first_.size()) < options_.min_points)
      return tl::unexpected(LostCause::kTooFewCorners);
    if (median_flow(views_) < options_.min_flow_px) return tl::unexpected(LostCause::kTooLittleParallax);
    const auto epipolar = estimate_relative_pose(first_, last_, ransac_options(options_.threshold_px));
    if (!epipolar || !enough(epipolar->inliers.size())) return tl::unexpected(LostCause::kNoCommonMotion);
    const auto rotation = estimate_view_rotation(first_, last_, ransac_options(options_.rotation_px));
    const auto moving = static_cast<double>(epipolar->inliers.size());
    if (!rotation || static_cast<double>(common(epipolar->inliers, rotation->inliers)) >
                         options_.max_rotation_share * moving) {
      return tl::unexpected(turned(rotation) ? LostCause::kRotatingOnly : LostCause::kTooLittleParallax);
    }
    inliers_ = epipolar->inliers;
    std::vector<SE3> motions{epipolar->T_b_a};
    const auto plane = estimate_homography(first_, last_, ransac_options(options_.rotation_px));
    if (plane && static_cast<double>(common(inliers_, plane->inliers)) > kPlaneShare * moving) {
      const auto any = static_cast<std::size_t>(plane->inliers.front());
      for (const SE3& motion : decompose_homography(plane->H_b_a, first_[any], last_[any]))
        motions.push_back(motion);
    }
    return best_of(motions);
  }

 private:
  [[nodiscard]] RansacOptions ransac_options(double threshold_px) const {
    RansacOptions ransac;
    ransac.threshold = threshold_px / rig_.camera.fx;
    ransac.confidence = 0.99;
    ransac.max_iterations = options_.max_samples;
    return ransac;
  }
  [[nodiscard]] bool enough(std::size_t inliers) const {
    return static_cast<int>(inliers) >= options_.min_points &&
           static_cast<double>(inliers) >= options_.min_share * static_cast<double>(first_.size());
  }
  [[nodiscard]] bool turned(const std::optional<ViewRotation>& rotation) const {
    return rotation && rotation->R_b_a.log().norm() * rig_.camera.fx > options_.min_flow_px;
  }

  /// The structure of the motion that explains all frames best, if no other one does nearly as well.
  tl::expected<FirstStructure, LostCause> best_of(const std::vector<SE3>& motions) const {
    std::vector<AnchoredViews> adjusted;
    std::vector<double> costs;
    for (const SE3& T_last_first : motions) {
      auto views = triangulate(T_last_first);
      if (!views || !views->minimise(kAdjustmentSteps)) continue;
      std::size_t support = 0;
      costs.push_back(capped_cost(*views, support));
      if (!enough(support)) costs.back() = std::numeric_limits<double>::infinity();
      adjusted.push_back(*std::move(views));
    }
    if (costs.empty()) return tl::unexpected(LostCause::kNoCommonMotion);
    const auto best = static_cast<std::size_t>(std::min_element(costs.begin(), costs.end()) - costs.begin());
    if (!std::isfinite(costs[best])) return tl::unexpected(LostCause::kNoCommonMotion);
    for (std::size_t m = 0; m < costs.size(); ++m) {
      if (costs[m] < costs[best] + kDecisiveChi2 && differ(adjusted[m], adjusted[best]))
        return tl::unexpected(LostCause::kPlaneUndecided);
    }
    return collect(adjusted[best]);
  }

  /// Two starts that came to different minima.
  static bool differ(const AnchoredViews& a, const AnchoredViews& b) {
    const SE3 &T_a = a.views[0].T_c_a, &T_b = b.views[0].T_c_a;
    constexpr double kSameDirection = 0.95;  // cosine
    constexpr double kSameAngle = 0.02;      // [rad]
    return (T_a.so3().inverse() * T_b.so3()).log().norm() > kSameAngle ||
           T_a.translation().normalized().dot(T_b.translation().normalized()) < kSameDirection;
  }

  /// Squared whitened errors of all corners in all frames; an outlier counts no more than one.
  /// @param support  corners that are none
  [[nodiscard]] double capped_cost(const AnchoredViews& views, std::size_t& support) const {
    double sum = 0;
    for (std::size_t k = 0; k < views.points.size(); ++k) {
      const AnchoredViews::Point& point = views.points[k];
      const Vector3 moved = point.psi - point.psi_prior;
      double chi2 = moved.dot(point.prior * moved);
      for (const AnchoredViews::View& view : views.views) {
        const auto p = project_inverse_depth(rig_, view.T_c_a, point.psi);
        chi2 += p ? ((p->z_hat - view.seen[k].z).head<2>() / options_.sigma_px).squaredNorm() : kOutlierChi2;
      }
      sum += std::min(chi2, kOutlierChi2);
      if (chi2 < kOutlierChi2) ++support;
    }
    return sum;
  }

  /// Depths of the inliers by the motion from first to last frame, and the pose of the frame between, by
  /// them.
  /// @return  nothing when they would be behind the camera
  std::optional<AnchoredViews> triangulate(const SE3& T_last_first) const {
    AnchoredViews views;
    views.rig = rig_;
    views.sigma_px = options_.sigma_px;
    std::vector<MotionObservation> seen_between;
    int in_front = 0, behind = 0;
    for (const int i : inliers_) {
      const auto n = static_cast<std::size_t>(i);
      const Vector3 turned = T_last_first.rotation() * first_[n];
      const Vector3 sight = last_[n].cross(T_last_first.translation());
      // turned + q t is along the bearing: least squares for q.
      const double q = -sight.dot(last_[n].cross(turned)) / sight.squaredNorm();
      const double sigma = options_.sigma_px / rig_.camera.fx / sight.norm();
      if (q > kSignificant * sigma) ++in_front;
      if (q < -kSignificant * sigma) ++behind;
      const InverseDepthFilter own =
          InverseDepthFilter::from_mono(rig_.camera, views_.first[n], options_.sigma_px, std::max(q, 1e-3));
      views.points.push_back({own.psi, own.psi, own.information});
      if (q <= kSignificant * sigma) continue;
      MotionObservation o;
      o.x_ref = from_inverse_depth(own.psi);
      o.z << views_.between[n].cast<float>(), 0;
      o.information.setConstant(static_cast<float>(1 / (options_.sigma_px * options_.sigma_px)));
      o.information.z() = 0;
      seen_between.push_back(o);
    }
    if (behind > kMostBehind * (in_front + behind)) return std::nullopt;
    const MotionOnlyResult between = optimise_motion(rig_, seen_between, SE3::exp(0.5 * T_last_first.log()),
                                                     {.inlier_chi2_mono = kOutlierChi2});
    views.views.resize(2);
    views.views[0].T_c_a = T_last_first;
    views.views[1].T_c_a = between.T_c_ref;
    for (std::size_t k = 0; k < inliers_.size(); ++k) {
      const auto n = static_cast<std::size_t>(inliers_[k]);
      const int point = static_cast<int>(k);
      views.views[0].seen.push_back({point, {views_.last[n].x(), views_.last[n].y(), Rig::kNoRight}});
      views.views[1].seen.push_back({point, {views_.between[n].x(), views_.between[n].y(), Rig::kNoRight}});
    }
    return views;
  }

  /// Standard deviation of the point's inverse depth over that, given the poses; infinite for an outlier.
  [[nodiscard]] double depth_error(const AnchoredViews& views, std::size_t k) const {
    InverseDepthFilter filter;
    filter.psi = views.points[k].psi;
    filter.information = views.points[k].prior;
    if (!(filter.psi.z() > 0)) return std::numeric_limits<double>::infinity();
    for (const AnchoredViews::View& view : views.views) {
      const auto p = project_inverse_depth(rig_, view.T_c_a, filter.psi);
      if (!p) return std::numeric_limits<double>::infinity();
      const Vector2 error = (p->z_hat - view.seen[k].z).head<2>() / options_.sigma_px;
      if (error.squaredNorm() > kOutlierChi2) return std::numeric_limits<double>::infinity();
      const Matrix23 J = p->J_psi.topRows<2>() / options_.sigma_px;
      filter.information += J.transpose() * J;
    }
    return filter.inverse_depth_sigma() / filter.psi.z();
  }

  tl::expected<FirstStructure, LostCause> collect(const AnchoredViews& views) const {
    FirstStructure structure;
    std::vector<double> errors, depths;
    for (std::size_t k = 0; k < views.points.size(); ++k) {
      const double error = depth_error(views, k);
      if (!std::isfinite(error)) continue;
      errors.push_back(error);
      if (error > kUsableDepthError) continue;
      structure.corners.push_back(inliers_[k]);
      structure.psi.push_back(views.points[k].psi);
      depths.push_back(1 / views.points[k].psi.z());
    }
    if (static_cast<int>(errors.size()) < options_.min_points)
      return tl::unexpected(LostCause::kNoCommonMotion);
    if (static_cast<int>(depths.size()) < options_.min_points ||
        median(std::move(errors)) > options_.max_depth_error)
      return tl::unexpected(LostCause::kTooLittleParallax);
    const double unit = median(std::move(depths));
    const SE3& T_last_first = views.views[0].T_c_a;
    structure.T_last_first = {T_last_first.so3(), T_last_first.translation() / unit};
    for (Vector3& psi : structure.psi) psi.z() *= unit;
    return structure;
  }

  Rig rig_;
  const CornerViews& views_;
  const FirstStructureOptions& options_;
  std::vector<Vector3> first_, last_;
  std::vector<int> inliers_;  ///< of the essential matrix
};

}  // namespace

std::string FirstStructureOptions::invalid_reason() const {
  return OptionCheck()
      .above("threshold_px", threshold_px, 0)
      .above("rotation_px", rotation_px, 0)
      .above("sigma_px", sigma_px, 0)
      .at_least("min_flow_px", min_flow_px, 0)
      .at_least("min_points", min_points, 5)
      .within("min_share", min_share, 0, 1)
      .within("max_rotation_share", max_rotation_share, 0, 1)
      .above("max_depth_error", max_depth_error, 0)
      .at_least("max_samples", max_samples, 1)
      .reason();
}

tl::expected<FirstStructure, LostCause> first_structure(const Rig& rig, const CornerViews& views,
                                                        const FirstStructureOptions& options) {
  return Attempt(rig, views, options).run();
}

}  // namespace twofold
