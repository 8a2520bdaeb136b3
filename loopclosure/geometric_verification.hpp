#pragma once

#include <functional>
#include <optional>
#include <span>
#include <string>

#include "camera/rig.hpp"
#include "geometry/se3.hpp"
#include "graph/place_appearance.hpp"

namespace twofold {

struct VerificationOptions {
  int max_distance = 50;       ///< of a match's descriptors [bits] >= 1
  double max_error_px = 3;     ///< reprojection error of an inlier, pixels of the corner's level, > 0
  double ransac_error_px = 9;  ///< ... while poses come from three points each, which are rough, > 0
  double max_stretch = 0.15;   ///< by so much of its length a sample's side may differ between the views, > 0
  /// A match counts only if its corner's direction turned between the views as the pose says, about the
  /// camera's axis, give or take this, in [0, 180].
  double max_turn_deg = 30;
  int max_samples = 300;          ///< triangles of matches, any two of which agree, >= 1
  int max_iterations = 5000;      ///< one camera: samples drawn, >= 1; most fail at their sides already
  int min_hypothesis = 5;         ///< matches that must agree before the pose is tried by guided matching,
                                  ///< >= 3; at least 6 for a lost single camera, whose pose needs 5
  double guided_radius_px = 8;    ///< of the first round of guided matching, pixels of the corner's level,
                                  ///< > 0; the later rounds take half of it
  int guided_distance = 64;       ///< descriptors in guided matching [bits] >= 1
  int min_inliers = 30;           ///< corners that agree with the pose, of those of guided matching, >= 4
  double min_inlier_share = 0.4;  ///< of the guided matches, in [0, 1]: what is near by chance seldom fits
  /// Inliers in the upper, lower, left and right half of either view, >= 0, so that the pose does not hang on
  /// one corner of the image. Half of min_inliers, as for metric loops (6.4.1), would refuse views that share
  /// half of what they see (docs/places.md).
  int min_in_half = 4;
  double min_disparity_px = 1;  ///< corners with less tell nothing about translation, >= 0

  /// Empty when valid; otherwise names the field, the rule and the value.
  [[nodiscard]] std::string invalid_reason() const;
};

/// A view of a place, and where it was seen from.
struct PlacedView {
  const PlaceAppearance* appearance = nullptr;
  SE3 T_v_a;  ///< pose relative to the place's own view a: p_v = T_v_a * p_a  [m]
};

struct VerifiedPlace {
  SE3 T_b_a;        ///< p_b = T_b_a * p_a, in the unit of the place  [m]
  int inliers = 0;  ///< corners of b within the error bound, each of a corner of the place that has depth
};

/// What became of a pair of views; for statistics and tests.
struct VerificationReport {
  int matches = 0;  ///< of descriptors, mutual, both with depth (a lost single camera's: the place's)
  int ransac_inliers = 0;
  int guided = 0;  ///< matched by guided search at the end
  int inliers = 0;
  bool well_spread = false;
};

/// Does view b show the place?  (thesis 5.3.1, 6.4.2)
///
/// Mutual nearest descriptors of b and the place's own view; of up to max_samples triangles of matches
/// that keep their lengths, as a rigid body does, and turn alike, the pose that fits most 3D-3D matches
/// (eq. 5.11 - 5.14 with s = 1, eq. 6.9), errors measured where they arise, in pixels. From the pose found
/// on, the corners of all views of the place are looked for in b: what one view missed, its neighbours may
/// have. A corner whose direction is not the one that the pose says is another. At least min_inliers of them,
/// well spread. Deterministic.
///
/// With one camera (rig.kind) depths come from the map (DepthRegression; rig.baseline is the one they were
/// written with), those of b in a unit that may have drifted: three points give a similarity (eq. 5.14), and
/// are drawn (RANSAC), as without a scale no two matches can contradict each other by a length.
/// Such depths propose; what counts are positions in the image.
/// When nothing is known of b's depths, five points propose, and the place's depths give the length of the
/// way.
///
/// @param a      the place's own view
/// @param place  asked for once a and b have proposed a pose, which most wrong places do not come to: a
///               again, with T_v_a = identity, then the views of its neighbours, if it has any
[[nodiscard]] std::optional<VerifiedPlace> verify_place(
    const Rig& rig, const PlaceAppearance& a, const std::function<std::span<const PlacedView>()>& place,
    const PlaceAppearance& b, const VerificationOptions& options, VerificationReport* report = nullptr);

/// The same, with all views at hand, the place's own first; none if there are no views.
[[nodiscard]] std::optional<VerifiedPlace> verify_place(const Rig& rig, std::span<const PlacedView> place,
                                                        const PlaceAppearance& b,
                                                        const VerificationOptions& options,
                                                        VerificationReport* report = nullptr);

}  // namespace twofold
