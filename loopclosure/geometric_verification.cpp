#include "loopclosure/geometric_verification.hpp"

#include <algorithm>
#include <cmath>

#include "base/angles.hpp"
#include "camera/image_halves.hpp"
#include "camera/measurement.hpp"
#include "loopclosure/corner_grid.hpp"
#include "loopclosure/corner_match.hpp"
#include "loopclosure/pose_hypothesis.hpp"

namespace twofold {
namespace {

/// A corner of the place that has depth.
struct PlacePoint {
  CornerMatch match;  ///< of no corner of b yet
  const BinaryDescriptor* descriptor = nullptr;
  double angle = 0;  ///< as the place's own view would have it, if it saw the corner
};

std::vector<PlacePoint> points_of(const Rig& rig, std::span<const PlacedView> place,
                                  const VerificationOptions& options) {
  std::vector<PlacePoint> points;
  for (std::size_t v = 0; v < place.size(); ++v) {
    const PlaceAppearance& view = *place[v].appearance;
    const SE3 T_a_v = place[v].T_v_a.inverse();
    const double turn = turn_of(T_a_v.rotation());
    for (std::size_t i = 0; i < view.corners.size(); ++i) {
      if (!has_depth(view.pixels[i], options.min_disparity_px)) continue;
      const Vector3 x_a = T_a_v * rig.unproject(view.pixels[i].cast<double>());
      points.push_back({{static_cast<int>(v), static_cast<int>(i), 0, x_a},
                        &view.corners[i].descriptor,
                        view.corners[i].angle + turn});
    }
  }
  return points;
}

/// Best partner in b, near to where T_b_a says, of each point of the place, if it is turned as T_b_a says; a
/// corner of b serves once.
std::vector<CornerMatch> match_guided(const Rig& rig, const std::vector<PlacePoint>& place,
                                      const PlaceAppearance& b, const CornerGrid& corners_of_b,
                                      const SE3& T_b_a, double radius_px,
                                      const VerificationOptions& options) {
  std::vector<CornerMatch> offered;
  std::vector<NearestDescriptor> of_b(b.corners.size());
  const Matrix3 R_b_a = T_b_a.rotation();
  const double turn = turn_of(R_b_a);
  const double max_turn = options.max_turn_deg * kDegree;
  for (const PlacePoint& point : place) {
    const Vector3 x_b = R_b_a * point.match.x_a + T_b_a.translation();
    const auto uv = rig.camera.find_in_view(x_b, kDescriptorBorder);
    if (!uv) continue;
    const NearestDescriptor nearest = corners_of_b.nearest(*uv, *point.descriptor, radius_px);
    if (nearest.best < 0 || nearest.distance > options.guided_distance) continue;
    const auto j = static_cast<std::size_t>(nearest.best);
    if (!nearly_same_direction(double{b.corners[j].angle}, point.angle + turn, max_turn)) continue;
    of_b[j].offer(static_cast<int>(offered.size()), nearest.distance);
    offered.push_back(point.match);
    offered.back().b = nearest.best;
  }
  std::vector<CornerMatch> matches;
  for (const NearestDescriptor& nearest : of_b) {
    if (nearest.best >= 0) matches.push_back(offered[static_cast<std::size_t>(nearest.best)]);
  }
  return matches;
}

std::vector<CornerMatch> keep_inliers(const Rig& rig, const PlaceAppearance& b,
                                      const std::vector<CornerMatch>& matches, const SE3& T_b_a,
                                      const VerificationOptions& options) {
  std::vector<CornerMatch> kept;
  for (const CornerMatch& match : matches) {
    const auto j = static_cast<std::size_t>(match.b);
    const Vector3 x_b = T_b_a * match.x_a;
    StereoPixelF z_b = b.pixels[j];
    // A corner without depth in b is judged by its place in the left image alone.
    if (!has_right(z_b) && in_front_of_camera(x_b)) z_b.z() = static_cast<float>(rig.project(x_b).z());
    const double bound = options.max_error_px * options.max_error_px;
    if (squared_error(rig, x_b, z_b, per_squared_pixel(b.corners[j].level)) <= bound) kept.push_back(match);
  }
  return kept;
}

/// Enough corners in each half of either image.
bool well_spread(const Rig& rig, std::span<const PlacedView> place, const PlaceAppearance& b,
                 const std::vector<CornerMatch>& matches, int min_in_half) {
  ImageHalves in_place(rig.camera), in_b(rig.camera);
  for (const CornerMatch& match : matches) {
    const PlaceAppearance& view = *place[static_cast<std::size_t>(match.view)].appearance;
    in_place.add(view.corners[static_cast<std::size_t>(match.corner)].uv);
    in_b.add(b.corners[static_cast<std::size_t>(match.b)].uv);
  }
  return std::min(in_place.least(), in_b.least()) >= min_in_half;
}

bool has_positions(const PlaceAppearance& view) {
  return view.pixels.size() == view.corners.size();
}

/// Searches, each from the pose that the one before gave, and in what share of guided_radius_px: half of it
/// is wide enough for a pose from many corners.
constexpr std::array kGuidedRadii{1.0, 0.5, 0.5};

}  // namespace

std::optional<VerifiedPlace> verify_place(const Rig& rig, std::span<const PlacedView> place,
                                          const PlaceAppearance& b, const VerificationOptions& options,
                                          VerificationReport* report) {
  if (place.empty()) return std::nullopt;
  return verify_place(
      rig, *place[0].appearance, [&] { return place; }, b, options, report);
}

std::optional<VerifiedPlace> verify_place(const Rig& rig, const PlaceAppearance& a,
                                          const std::function<std::span<const PlacedView>()>& place_of_a,
                                          const PlaceAppearance& b, const VerificationOptions& options,
                                          VerificationReport* report) {
  VerificationReport unwanted;
  VerificationReport& r = report != nullptr ? *report : unwanted;
  r = {};
  if (!has_positions(a) || !has_positions(b)) return std::nullopt;
  const auto hypothesis = find_pose_hypothesis(rig, a, b, options, r);
  if (!hypothesis) return std::nullopt;
  const std::span<const PlacedView> place = place_of_a();
  for (const PlacedView& view : place) {
    if (!has_positions(*view.appearance)) return std::nullopt;
  }

  SE3 T_b_a = *hypothesis;
  const std::vector<PlacePoint> points = points_of(rig, place, options);
  const CornerGrid corners_of_b(rig.camera, b.corners, options.guided_radius_px);
  std::vector<CornerMatch> inliers;
  for (const double radius : kGuidedRadii) {
    const std::vector<CornerMatch> guided =
        match_guided(rig, points, b, corners_of_b, T_b_a, radius * options.guided_radius_px, options);
    r.guided = static_cast<int>(guided.size());
    T_b_a = fit_pose_to_corners(rig, b, guided, T_b_a);
    inliers = keep_inliers(rig, b, guided, T_b_a, options);
  }
  r.inliers = static_cast<int>(inliers.size());
  r.well_spread = well_spread(rig, place, b, inliers, options.min_in_half);
  if (r.inliers < options.min_inliers || r.inliers < options.min_inlier_share * r.guided || !r.well_spread) {
    return std::nullopt;
  }
  return VerifiedPlace{T_b_a, r.inliers};
}

}  // namespace twofold
