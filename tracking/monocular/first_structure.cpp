#include "tracking/monocular/first_structure.hpp"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <span>
#include <utility>

#include "base/median.hpp"
#include "base/option_check.hpp"
#include "camera/rolling_shutter.hpp"
#include "estimation/motion_only.hpp"
#include "filters/anchored_views.hpp"
#include "filters/inverse_depth_filter.hpp"
#include "geometry/essential_matrix.hpp"
#include "geometry/homography.hpp"
#include "geometry/inverse_depth.hpp"
#include "geometry/view_rotation.hpp"

namespace twofold {
namespace {

std::vector<Vector3> bearings(const PinholeCamera& camera, const std::vector<Vector2>& pixels) {
  std::vector<Vector3> result;
  result.reserve(pixels.size());
  for (const Vector2& uv : pixels) result.push_back(camera.unproject(uv));
  return result;
}

std::vector<Vector2> at_mid_exposure(const PinholeCamera& camera, const std::vector<Vector2>& pixels,
                                     const std::vector<Vector2>& motion, double share) {
  std::vector<Vector2> result;
  result.reserve(pixels.size());
  for (std::size_t i = 0; i < pixels.size(); ++i)
    result.push_back(followed_to_mid_exposure(camera, pixels[i], motion[i], share));
  return result;
}

/// Between the values that a tenth each lie below and above.
double extent(std::vector<double> values) {
  return quantile(values, 0.9, QuantileRank::kNearest) - quantile(values, 0.1, QuantileRank::kNearest);
}

double median_flow(const CornerViews& views) {
  std::vector<double> flow;
  for (std::size_t i = 0; i < views.first.size(); ++i)
    flow.push_back((views.last[i] - views.first[i]).norm());
  return median(std::span(flow));
}

/// Size of the intersection of two ascending lists.
std::size_t common(const std::vector<int>& a, const std::vector<int>& b) {
  std::vector<int> both;
  std::set_intersection(a.begin(), a.end(), b.begin(), b.end(), std::back_inserter(both));
  return both.size();
}

/// Everything about one attempt to start.
class FirstStructureEstimator {
 public:
  FirstStructureEstimator(const Rig& rig, const CornerViews& views, const FirstStructureOptions& options)
      : rig_(rig),
        views_(views),
        options_(options),
        first_(bearings(rig.camera, views.first)),
        last_(bearings(rig.camera, views.last)) {
    rig_.kind = SensorKind::kMono;
    rig_.baseline = 0;
    rig_.noise.sigma_px = options.sigma_px;
  }

  tl::expected<FirstStructure, LostCause> run() {
    if (static_cast<int>(first_.size()) < options_.min_points)
      return tl::unexpected(LostCause::kTooFewCorners);
    if (median_flow(views_) < options_.min_flow_px) return tl::unexpected(LostCause::kTooLittleParallax);
    const auto epipolar = estimate_relative_pose(first_, last_, ransac_options(options_.threshold_px));
    if (!epipolar || !enough(epipolar->inliers.size())) return tl::unexpected(LostCause::kNoCommonMotion);
    inliers_ = epipolar->inliers;
    if (const LostCause cause = judge_rotation(); cause != LostCause::kNone) return tl::unexpected(cause);
    const auto moving = static_cast<double>(inliers_.size());
    std::vector<SE3> motions{epipolar->T_b_a};
    const auto plane = estimate_homography(first_, last_, ransac_options(options_.rotation_px));
    if (plane && static_cast<double>(common(inliers_, plane->inliers)) > options_.min_plane_share * moving) {
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

  /// What the essential matrix explains, a rotation may explain as well.
  /// @return kNone when none does, through whatever readout
  [[nodiscard]] LostCause judge_rotation() const {
    const int readouts = readouts_told_apart();
    for (int n = 0; n <= readouts; ++n) {
      const auto rotation = rotation_through(n == 0 ? 0 : static_cast<double>(n) / readouts);
      if (!rotation || static_cast<double>(common(inliers_, rotation->inliers)) >
                           options_.max_rotation_share * static_cast<double>(inliers_.size())) {
        return turned(rotation) ? LostCause::kRotatingOnly : LostCause::kTooLittleParallax;
      }
    }
    return LostCause::kNone;
  }
  /// The rotation that explains most, if the rows take that share of the frames' interval to be read.
  [[nodiscard]] std::optional<ViewRotation> rotation_through(double share) const {
    const RansacOptions ransac = ransac_options(options_.rotation_px);
    if (share == 0) return estimate_view_rotation(first_, last_, ransac);
    const PinholeCamera& camera = rig_.camera;
    return estimate_view_rotation(
        bearings(camera, at_mid_exposure(camera, views_.first, views_.first_motion, share)),
        bearings(camera, at_mid_exposure(camera, views_.last, views_.last_motion, share)), ransac);
  }
  /// Shares tried beside none: so many that hardly a corner moves by more than rotation_px from one to the
  /// next.
  [[nodiscard]] int readouts_told_apart() const {
    if (views_.first_motion.empty()) return 0;
    const auto first = at_mid_exposure(rig_.camera, views_.first, views_.first_motion, 1);
    const auto last = at_mid_exposure(rig_.camera, views_.last, views_.last_motion, 1);
    std::vector<double> sheared;
    for (std::size_t i = 0; i < first.size(); ++i)
      sheared.push_back((last[i] - views_.last[i] - first[i] + views_.first[i]).norm());
    const double most = quantile(sheared, options_.shear_quantile, QuantileRank::kNearest);
    return static_cast<int>(
        std::clamp(std::ceil(most / options_.rotation_px), 1.0, 1.0 * options_.max_readouts));
  }

  /// One motion tried: the frames as it explains them. Corners that it does not are put aside.
  struct Trial {
    AnchoredViews views;
    std::vector<int> corners;  ///< in step with views.points, and with what each view has seen
    double cost = std::numeric_limits<double>::infinity();
    double sigma_px = 0;  ///< of its corners, by their residuals
  };

  /// The structure of the motion that explains all frames best, if no other one does nearly as well.
  tl::expected<FirstStructure, LostCause> best_of(const std::vector<SE3>& motions) const {
    std::vector<Trial> trials;
    for (const SE3& T_last_first : motions) {
      if (auto trial = triangulate(T_last_first); trial && adjust(Stage::kRough, *trial))
        trials.push_back(*std::move(trial));
    }
    give_up_hopeless(trials);
    std::erase_if(trials, [&](Trial& trial) { return !adjust(Stage::kFine, trial); });
    if (trials.empty()) return tl::unexpected(LostCause::kNoCommonMotion);
    const Trial& best = find_best(trials);
    for (const Trial& other : trials) {
      if (other.cost < best.cost + options_.decisive_chi2 && differ(other.views, best.views))
        return tl::unexpected(LostCause::kPlaneUndecided);
    }
    return collect(best);
  }

  /// Sets all costs, by the sigma of the motion that fits best.
  const Trial& find_best(std::vector<Trial>& trials) const {
    const double sigma_px = std::min_element(trials.begin(), trials.end(), [](auto& a, auto& b) {
                              return a.sigma_px < b.sigma_px;
                            })->sigma_px;
    for (Trial& trial : trials) trial.cost = cost(trial, sigma_px);
    return *std::min_element(trials.begin(), trials.end(), [](auto& a, auto& b) { return a.cost < b.cost; });
  }

  /// After the rough adjustment most are decided: two that came to about the same motion end at the same
  /// minimum, and one that explains far less than the best never catches up.
  void give_up_hopeless(std::vector<Trial>& trials) const {
    if (trials.size() < 2) return;
    const Trial* best = &find_best(trials);
    const double hopeless = options_.hopeless_ratio * best->cost + options_.decisive_chi2;
    std::vector<Trial> kept{*best};
    for (const Trial& trial : trials) {
      if (&trial != best && trial.cost < hopeless && differ(trial.views, best->views)) kept.push_back(trial);
    }
    trials = std::move(kept);
  }

  enum class Stage : std::uint8_t { kRough, kFine };

  /// Bundle adjustment without the corners that follow something else.
  /// @return false when too few are left
  bool adjust(Stage stage, Trial& trial) const {
    const bool rough = stage == Stage::kRough;
    put_outliers_aside(rough ? options_.gross_chi2 : options_.outlier_chi2, trial);
    if (!enough(trial.corners.size()) ||
        !trial.views.minimise(options_.adjustment_steps, rough ? options_.first_gain : options_.min_gain))
      return false;
    if (!rough) put_outliers_aside(options_.outlier_chi2, trial);
    trial.sigma_px = measured_sigma(trial.views);
    return enough(trial.corners.size());
  }

  /// Two starts that came to different minima.
  [[nodiscard]] bool differ(const AnchoredViews& a, const AnchoredViews& b) const {
    const SE3 &T_a = a.views[0].T_c_a, &T_b = b.views[0].T_c_a;
    return (T_a.so3().inverse() * T_b.so3()).log().norm() > options_.same_angle ||
           T_a.translation().normalized().dot(T_b.translation().normalized()) < options_.same_direction;
  }

  void put_outliers_aside(double bound, Trial& trial) const {
    AnchoredViews& views = trial.views;
    const std::vector<double> errors = views.worst_errors();
    std::size_t kept = 0;
    for (std::size_t k = 0; k < views.points.size(); ++k) {
      if (!(errors[k] < bound)) continue;
      views.points[kept] = views.points[k];
      trial.corners[kept] = trial.corners[k];
      for (AnchoredViews::View& view : views.views) view.pixels[kept] = view.pixels[k];
      ++kept;
    }
    views.points.resize(kept);
    trial.corners.resize(kept);
    for (AnchoredViews::View& view : views.views) view.pixels.resize(kept);
  }

  /// Standard deviation of the corners that the adjustment's residuals show, within reason: on a sharp image
  /// they are followed to a fraction of what must be expected of a poor one.
  [[nodiscard]] double measured_sigma(const AnchoredViews& views) const {
    const auto points = static_cast<double>(views.points.size());
    const auto frames = static_cast<double>(views.views.size());
    const double freedom = std::max(1.0, 2 * points * (frames + 1) - 3 * points - 6 * frames);
    return std::clamp(options_.sigma_px * std::sqrt(views.cost() / freedom),
                      options_.finest_sigma * options_.sigma_px, options_.sigma_px);
  }

  /// Over the inliers, the squared error of each in the frame that it fits least, whitened by sigma_px. One
  /// that fits no better than chance counts as an outlier, whether it was put aside or not.
  [[nodiscard]] double cost(const Trial& trial, double sigma_px) const {
    const double finer = (options_.sigma_px / sigma_px) * (options_.sigma_px / sigma_px);
    double sum = static_cast<double>(inliers_.size() - trial.corners.size()) * options_.outlier_chi2;
    for (const double error : trial.views.worst_errors())
      sum += std::min(finer * error, options_.outlier_chi2);
    return sum;
  }

  /// Depths of the inliers by the motion from first to last frame, and the poses of the frames between, by
  /// them.
  /// @return  nothing when they would be behind the camera
  std::optional<Trial> triangulate(const SE3& T_last_first) const {
    Trial trial{{}, inliers_};
    AnchoredViews& views = trial.views;
    views.camera = rig_.camera;
    views.sigma_px = options_.sigma_px;
    std::vector<char> usable;  // of the inliers, in step: its depth is known
    int in_front = 0, behind = 0;
    for (const int i : inliers_) {
      const auto n = static_cast<std::size_t>(i);
      const Vector3 turned = T_last_first.rotation() * first_[n];
      const Vector3 sight = last_[n].cross(T_last_first.translation());
      // turned + q t is along the bearing: least squares for q.
      const double q = -sight.dot(last_[n].cross(turned)) / sight.squaredNorm();
      const double sigma = options_.sigma_px / rig_.camera.fx / sight.norm();
      if (q > options_.significant_sigmas * sigma) ++in_front;
      if (q < -options_.significant_sigmas * sigma) ++behind;
      const InverseDepthFilter own =
          InverseDepthFilter::from_mono(rig_.camera, views_.first[n], options_.sigma_px, std::max(q, 1e-3));
      views.points.push_back({own.psi, own.psi, own.information});
      usable.push_back(q > options_.significant_sigmas * sigma);
    }
    if (behind > options_.max_behind_share * (in_front + behind)) return std::nullopt;
    views.views.push_back({T_last_first, seen(views_.last)});
    const auto pieces = static_cast<double>(views_.between.size() + 1);
    for (std::size_t b = 0; b < views_.between.size(); ++b) {
      const double share = static_cast<double>(b + 1) / pieces;
      const SE3 start = SE3::exp(share * T_last_first.log());
      views.views.push_back(
          {pose_by(views.points, usable, views_.between[b], start), seen(views_.between[b])});
    }
    return trial;
  }

  /// The inliers as a frame saw them.
  [[nodiscard]] std::vector<Vector2> seen(const std::vector<Vector2>& pixels) const {
    std::vector<Vector2> result;
    result.reserve(inliers_.size());
    for (const int i : inliers_) result.push_back(pixels[static_cast<std::size_t>(i)]);
    return result;
  }

  /// Pose of a frame by the points whose depth is known.
  [[nodiscard]] SE3 pose_by(const std::vector<AnchoredViews::Point>& points, const std::vector<char>& usable,
                            const std::vector<Vector2>& pixels, const SE3& start) const {
    std::vector<MotionObservation> observations;
    for (std::size_t k = 0; k < inliers_.size(); ++k) {
      if (!usable[k]) continue;
      const Vector2& uv = pixels[static_cast<std::size_t>(inliers_[k])];
      const StereoPixel z(uv.x(), uv.y(), Rig::kNoRight);
      observations.push_back(observe_point(rig_, from_inverse_depth(points[k].psi), z.cast<float>(), 0));
    }
    return optimise_motion(rig_, observations, start, {.inlier_chi2_mono = options_.outlier_chi2}).T_c_ref;
  }

  /// Standard deviation of the point's inverse depth over that, given the poses; infinite behind infinity.
  /// By the last frame and one half way: more of them have followed the corner with the same error.
  [[nodiscard]] double depth_error(const AnchoredViews& views, std::size_t k, double sigma_px) const {
    const double finer = options_.sigma_px / sigma_px;
    InverseDepthFilter filter;
    filter.psi = views.points[k].psi;
    filter.information = finer * finer * views.points[k].prior;
    if (!(filter.psi.z() > 0)) return std::numeric_limits<double>::infinity();
    for (const std::size_t v : {std::size_t{0}, views.views.size() / 2}) {
      const auto p = project_inverse_depth(rig_, views.views[v].T_c_a, filter.psi);
      if (!p) return std::numeric_limits<double>::infinity();
      const Matrix23 J = p->J_psi.topRows<2>() / sigma_px;
      filter.information += J.transpose() * J;
    }
    return filter.inverse_depth_sigma() / filter.psi.z();
  }

  /// Too many corners stand still in all frames where this motion would have moved them at the median depth,
  /// one: the camera stands, and something that hides much of its view moves. A translation alone explains
  /// them, too, as far away; but who carries a camera turns it a little. In a strip across the image they are
  /// taken for what moves with the camera.
  [[nodiscard]] bool something_passes(const SE3& T_last_first) const {
    std::vector<double> v, v_still;
    for (std::size_t i = 0; i < first_.size(); ++i) {
      const Vector2& uv = views_.first[i];
      v.push_back(uv.y());
      const Vector3 p = T_last_first * first_[i];
      const bool stays =
          in_front_of_camera(p) && (rig_.camera.project(p) - uv).norm() < 2 * options_.rotation_px;
      if (stays || !stands(i)) continue;
      v_still.push_back(uv.y());
    }
    const auto all = static_cast<double>(v.size());
    if (static_cast<double>(v_still.size()) <= options_.max_still_share * all) return false;
    return extent(std::move(v_still)) > options_.fixed_strip * extent(std::move(v));
  }
  [[nodiscard]] bool stands(std::size_t i) const {
    const auto near = [&](const Vector2& uv) { return (uv - views_.first[i]).norm() < options_.rotation_px; };
    return near(views_.last[i]) && std::all_of(views_.between.begin(), views_.between.end(),
                                               [&](auto& seen) { return near(seen[i]); });
  }

  tl::expected<FirstStructure, LostCause> collect(const Trial& trial) const {
    const AnchoredViews& views = trial.views;
    FirstStructure structure;
    std::vector<double> errors, depths;
    for (std::size_t k = 0; k < views.points.size(); ++k) {
      const double error = depth_error(views, k, trial.sigma_px);
      if (!std::isfinite(error)) continue;
      errors.push_back(error);
      if (error > options_.max_point_error) continue;
      structure.corners.push_back(trial.corners[k]);
      structure.psi.push_back(views.points[k].psi);
      depths.push_back(1 / views.points[k].psi.z());
    }
    if (static_cast<int>(errors.size()) < options_.min_points)
      return tl::unexpected(LostCause::kNoCommonMotion);
    if (static_cast<int>(depths.size()) < options_.min_points ||
        quantile(errors, options_.near_share, QuantileRank::kNearest) > options_.max_depth_error)
      return tl::unexpected(LostCause::kTooLittleParallax);
    const double unit = median(std::span(depths));
    const SE3& T_last_first = views.views[0].T_c_a;
    structure.T_last_first = {T_last_first.so3(), T_last_first.translation() / unit};
    if (something_passes(structure.T_last_first)) return tl::unexpected(LostCause::kNoCommonMotion);
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
      .share("min_share", min_share)
      .share("max_rotation_share", max_rotation_share)
      .above("max_depth_error", max_depth_error, 0)
      .at_least("max_samples", max_samples, 1)
      .within("max_behind_share", max_behind_share, 0, 1)
      .within("min_plane_share", min_plane_share, 0, 1)
      .at_least("decisive_chi2", decisive_chi2, 0)
      .at_least("hopeless_ratio", hopeless_ratio, 1)
      .share("finest_sigma", finest_sigma)
      .above("max_point_error", max_point_error, 0)
      .share("near_share", near_share)
      .within("max_still_share", max_still_share, 0, 1)
      .within("fixed_strip", fixed_strip, 0, 1)
      .at_least("significant_sigmas", significant_sigmas, 0)
      .above("gross_chi2", gross_chi2, 0)
      .above("outlier_chi2", outlier_chi2, 0)
      .at_least("adjustment_steps", adjustment_steps, 1)
      .above("first_gain", first_gain, 0)
      .above("min_gain", min_gain, 0)
      .within("same_direction", same_direction, -1, 1)
      .at_least("same_angle", same_angle, 0)
      .share("shear_quantile", shear_quantile)
      .at_least("max_readouts", max_readouts, 1)
      .reason();
}

tl::expected<FirstStructure, LostCause> first_structure(const Rig& rig, const CornerViews& views,
                                                        const FirstStructureOptions& options) {
  return FirstStructureEstimator(rig, views, options).run();
}

}  // namespace twofold
