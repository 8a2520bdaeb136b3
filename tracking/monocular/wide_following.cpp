#include "tracking/monocular/wide_following.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>

#include "base/median.hpp"
#include "base/option_check.hpp"
#include "geometry/essential_matrix.hpp"
#include "imaging/level_pixels.hpp"
#include "imaging/patch.hpp"

namespace twofold {
namespace {

/// Least squares inverse depth of a bearing of the previous frame, in units of the step's length.
double triangulated(const Vector3& previous, const Vector3& current, const SE3& T_cur_prev) {
  const Vector3 sight = current.cross(T_cur_prev.translation());
  const double squared = sight.squaredNorm();
  return squared > 0 ? -sight.dot(current.cross(T_cur_prev.rotation() * previous)) / squared : 0;
}

}  // namespace

std::string WideFollowingOptions::invalid_reason() const {
  return OptionCheck()
      .within("followed_share", followed_share, 0, 1)
      .at_least("wanted", wanted, 1)
      .at_least("rounds", rounds, 1)
      .nested("corners", corners.invalid_reason())
      .at_least("max_distance", max_distance, 1)
      .above("threshold_px", threshold_px, 0)
      .at_least("max_samples", max_samples, 1)
      .at_least("min_agreeing", min_agreeing, 5)
      .above("nearest", nearest, 0)
      .at_least("depth_ranges", depth_ranges, 1)
      .share("unambiguous", unambiguous)
      .nested("search", search.invalid_reason())
      .nested("line", line.invalid_reason())
      .reason();
}

WideFollowing::WideFollowing(const Rig& rig, const WideFollowingOptions& options)
    : rig_(rig), options_(options), selector_(options.corners) {}

void WideFollowing::follow(const ImagePyramid& previous, const ImagePyramid& current,
                           std::span<FollowedCorner> corners, std::span<char> seen) {
  pairs_.clear();
  for (std::size_t i = 0; i < corners.size(); ++i) {
    if (seen[i] == 0) continue;
    const Vector2 uv = corners[i].uv.cast<double>();
    pairs_.push_back({uv - corners[i].motion.value_or(Eigen::Vector2f::Zero()).cast<double>(), uv});
  }
  match_lost(previous, current, corners, seen);
  auto motion = coarse_motion();
  const int rounds = options_.rounds;
  for (int round = 0; motion && round < rounds; ++round) {
    find_lost(previous, current, *motion, corners, seen);
    if (round + 1 < rounds) motion = coarse_motion();
  }
}

void WideFollowing::find_lost(const ImagePyramid& previous, const ImagePyramid& current,
                              const CoarseMotion& motion, std::span<FollowedCorner> corners,
                              std::span<char> seen) {
  for (std::size_t i = 0; i < corners.size(); ++i) {
    if (seen[i] != 0 || !find(previous, current, motion, corners[i])) continue;
    seen[i] = 1;
    const Vector2 uv = corners[i].uv.cast<double>();
    pairs_.push_back({uv - corners[i].motion->cast<double>(), uv});
  }
}

void WideFollowing::describe_current(const ImagePyramid& current) {
  if (described_) return;
  selector_.select(current, current_);
  describer_.describe(current, current_);
  described_ = true;
}

/// Adds those that look like one corner of the current frame more than any other does, and the other way
/// round.
void WideFollowing::match_lost(const ImagePyramid& previous, const ImagePyramid& current,
                               std::span<const FollowedCorner> corners, std::span<const char> seen) {
  lost_.clear();
  for (std::size_t i = 0; i < corners.size(); ++i) {
    if (seen[i] == 0) lost_.push_back({corners[i].uv, corners[i].appearance.level, 0, {}});
  }
  describer_.describe(previous, lost_);
  describe_current(current);
  find_nearest(lost_, current_, of_lost_, of_current_);
  for (std::size_t i = 0; i < lost_.size(); ++i) {
    const NearestDescriptor& nearest = of_lost_[i];
    if (nearest.best < 0 || nearest.distance > options_.max_distance) continue;
    const auto j = static_cast<std::size_t>(nearest.best);
    if (of_current_[j].best != static_cast<int>(i)) continue;
    pairs_.push_back({lost_[i].uv.cast<double>(), current_[j].uv.cast<double>()});
  }
}

std::optional<WideFollowing::CoarseMotion> WideFollowing::coarse_motion() const {
  std::vector<Vector3> previous, current;
  for (const Pair& pair : pairs_) {
    previous.push_back(rig_.camera.unproject(pair.previous));
    current.push_back(rig_.camera.unproject(pair.current));
  }
  RansacOptions ransac;
  ransac.threshold = options_.threshold_px / rig_.camera.fx;
  ransac.max_iterations = options_.max_samples;
  const auto epipolar = estimate_relative_pose(previous, current, ransac);
  if (!epipolar || static_cast<int>(epipolar->inliers.size()) < options_.min_agreeing) return std::nullopt;
  std::vector<double> inverse_depths;
  for (const int i : epipolar->inliers) {
    const auto n = static_cast<std::size_t>(i);
    inverse_depths.push_back(triangulated(previous[n], current[n], epipolar->T_b_a));
  }
  constexpr double kNear = 0.9;  // quantile: beyond it wrong matches are among them
  const double near = quantile(inverse_depths, kNear, QuantileRank::kNearest);
  if (!(near > 0)) return std::nullopt;
  return CoarseMotion{epipolar->T_b_a, options_.nearest * near};
}

/// Along its epipolar line, once for each range of inverse depths; nothing where two of them are about as
/// alike.
std::optional<PointMatch> WideFollowing::most_alike(const ImagePyramid& current,
                                                    const PointAppearance& appearance,
                                                    const CoarseMotion& motion) const {
  const Vector3 ray = rig_.camera.unproject(appearance.uv.cast<double>());
  const float beside_px = std::ldexp(options_.line.beside_px, appearance.level);
  const double step = motion.nearest / options_.depth_ranges;
  std::optional<PointMatch> best;
  float elsewhere = std::numeric_limits<float>::max();  // least difference away from the best
  for (int n = 0; n < options_.depth_ranges; ++n) {
    const InverseDepthRange range{n * step, (n + 1) * step, (n + 0.5) * step};
    const auto stretch =
        epipolar_stretch(rig_.camera, appearance, ray, motion.T_cur_prev, range, options_.line);
    if (!stretch) continue;
    const auto found = find_along(current, appearance, *stretch, options_.search, options_.line);
    if (!found) continue;
    const bool better = !best || found->rms < best->rms;
    if (best && (found->pixel - best->pixel).head<2>().norm() > beside_px)
      elsewhere = std::min(elsewhere, better ? best->rms : found->rms);
    if (better) best = found;
  }
  return best && best->rms < options_.unambiguous * elsewhere ? best : std::nullopt;
}

bool WideFollowing::find(const ImagePyramid& previous, const ImagePyramid& current,
                         const CoarseMotion& motion, FollowedCorner& corner) const {
  const int level = corner.appearance.level;
  const Eigen::Vector2f at = to_level(corner.uv.cast<double>(), level);
  PointAppearance appearance;
  if (!cut_appearance(previous.level(level), static_cast<int>(std::lround(at.x())),
                      static_cast<int>(std::lround(at.y())), level, appearance))
    return false;
  const auto found = most_alike(current, appearance, motion);
  if (!found) return false;
  corner.motion = found->pixel.head<2>().cast<float>() - appearance.uv;
  corner.uv += *corner.motion;
  return true;
}

}  // namespace twofold
