#include "loopclosure/pose_hypothesis.hpp"

#include <algorithm>
#include <span>

#include "base/median.hpp"
#include "geometry/essential_matrix.hpp"
#include "geometry/ransac.hpp"
#include "imaging/binary_descriptor.hpp"
#include "loopclosure/corner_match.hpp"
#include "loopclosure/similarity_estimator.hpp"

namespace twofold {
namespace {

constexpr int kMinAgreeing = 6;  // five points always agree with a pose of their own

std::vector<CornerMatch> match_descriptors(const Rig& rig, const PlaceAppearance& a, const PlaceAppearance& b,
                                           const VerificationOptions& options, bool depth_in_b) {
  std::vector<NearestDescriptor> of_a, of_b;
  find_nearest(a.corners, b.corners, of_a, of_b);
  std::vector<CornerMatch> matches;
  for (std::size_t i = 0; i < of_a.size(); ++i) {
    const NearestDescriptor& nearest = of_a[i];
    if (nearest.best < 0 || nearest.distance > options.max_distance) continue;
    const auto j = static_cast<std::size_t>(nearest.best);
    if (of_b[j].best != static_cast<int>(i)) continue;
    if (!has_depth(a.pixels[i], options.min_disparity_px) ||
        (depth_in_b && !has_depth(b.pixels[j], options.min_disparity_px)))
      continue;
    matches.push_back({0, static_cast<int>(i), nearest.best, rig.unproject(a.pixels[i].cast<double>())});
  }
  return matches;
}

/// Pose of a camera that knows no depths at all: by the directions of the matches (five points), and by the
/// length of the way that gives the place's points the depths they have.
std::optional<SE3> pose_by_directions(const Rig& rig, const PlaceAppearance& b,
                                      const std::vector<CornerMatch>& matches,
                                      const VerificationOptions& options, VerificationReport& report) {
  std::vector<Vector3> bearings_a, bearings_b;
  for (const CornerMatch& match : matches) {
    bearings_a.push_back(match.x_a / match.x_a.z());
    bearings_b.push_back(
        rig.camera.unproject(b.pixels[static_cast<std::size_t>(match.b)].head<2>().cast<double>()));
  }
  RansacOptions ransac;
  ransac.threshold = options.max_error_px / rig.camera.fx;
  const auto epipolar = estimate_relative_pose(bearings_a, bearings_b, ransac);
  if (!epipolar) return std::nullopt;
  report.ransac_inliers = static_cast<int>(epipolar->inliers.size());
  if (report.ransac_inliers < std::max(options.min_hypothesis, kMinAgreeing)) return std::nullopt;
  const SE3& T_b_a = epipolar->T_b_a;
  std::vector<CornerMatch> inliers;
  std::vector<double> lengths;
  for (const int i : epipolar->inliers) {
    const auto m = static_cast<std::size_t>(i);
    inliers.push_back(matches[m]);
    // R x_a + length t is along the bearing: least squares for the length.
    const Vector3 across = bearings_b[m].cross(T_b_a.translation());
    lengths.push_back(-across.dot(bearings_b[m].cross(T_b_a.so3() * matches[m].x_a)) / across.squaredNorm());
  }
  return fit_pose_to_corners(rig, b, inliers,
                             SE3(T_b_a.so3(), median(std::span(lengths)) * T_b_a.translation()));
}

/// RANSAC without chance: few of the matches are right where the view has changed, and draws miss them, or
/// not, by their seed.
std::optional<RansacResult<TwoWaySimilarity>> best_of_all(const SimilarityEstimator& estimator,
                                                          const VerificationOptions& options) {
  const auto samples = estimator.agreements().triples(static_cast<std::size_t>(options.max_samples));
  return best_of_samples(estimator, std::span(samples), options.ransac_error_px);
}

}  // namespace

std::optional<SE3> find_pose_hypothesis(const Rig& rig, const PlaceAppearance& a, const PlaceAppearance& b,
                                        const VerificationOptions& options, VerificationReport& report) {
  const bool depth_in_b = rig.kind != SensorKind::kMono ||
                          std::any_of(b.pixels.begin(), b.pixels.end(),
                                      [&](const auto& z) { return has_depth(z, options.min_disparity_px); });
  const std::vector<CornerMatch> matches = match_descriptors(rig, a, b, options, depth_in_b);
  report.matches = static_cast<int>(matches.size());
  if (!depth_in_b) return pose_by_directions(rig, b, matches, options, report);
  const SimilarityEstimator estimator(rig, a, b, matches, options);
  const auto found = rig.kind != SensorKind::kMono
                         ? best_of_all(estimator, options)
                         : ransac(estimator, {.threshold = options.ransac_error_px,
                                              .max_iterations = options.max_iterations});
  if (!found) return std::nullopt;
  report.ransac_inliers = static_cast<int>(found->inliers.size());
  if (report.ransac_inliers < options.min_hypothesis) return std::nullopt;
  std::vector<CornerMatch> inliers;
  for (const int i : found->inliers) inliers.push_back(matches[static_cast<std::size_t>(i)]);
  return fit_pose_to_corners(rig, b, inliers, found->model.S_b_a.without_scale());
}

}  // namespace twofold
