#pragma once

#include <optional>
#include <string>

#include "camera/rig.hpp"
#include "geometry/se3.hpp"
#include "graph/place_appearance.hpp"

namespace twofold {

struct VerificationOptions {
  int max_distance = 70;    ///< of a match's descriptors [bits]
  double max_ratio = 0.85;  ///< of the best to the second best distance, in (0, 1]
  int min_inliers = 30;     ///< Theta
  double min_inlier_share =
      0.3;                      ///< of the corners that should be visible in the other view and were matched
  double max_error_px = 3;      ///< reprojection error of an inlier, pixels of the corner's level
  double guided_radius_px = 6;  ///< guided matching around the prediction, pixels of the corner's level
  int guided_distance = 80;     ///< descriptors in guided matching [bits]
  int max_iterations = 1500;    ///< RANSAC: finds a good sample at inlier shares down to a sixth (0.999)
  double min_disparity_px = 1;  ///< corners farther than this tell nothing about translation

  /// Empty when valid; otherwise names the field, the rule and the value.
  [[nodiscard]] std::string invalid_reason() const;
};

struct VerifiedPlace {
  SE3 T_b_a;        ///< p_b = T_b_a * p_a  [m]
  int inliers = 0;  ///< guided matches within the error bound, each with depth in a
};

/// What became of a pair of views; for statistics and tests.
struct VerificationReport {
  int matches = 0;  ///< of descriptors, mutual and unambiguous, both with depth
  int ransac_inliers = 0;
  int guided = 0;  ///< matched by guided search at the end
  int inliers = 0;
  bool well_spread = false;
};

/// Do two keyframes see the same place?  (thesis 5.3.1, 6.4.2)
///
/// Mutual nearest descriptors; 3-point RANSAC on 3D-3D matches (eq. 5.11 - 5.14 with s = 1, eq. 6.9), errors
/// measured where they arise, in pixels; guided matching with the pose found; robust refinement; at least
/// Theta inliers, spread over both halves of the image in each direction, as metric closures must be (6.4.1).
/// Deterministic.
[[nodiscard]] std::optional<VerifiedPlace> verify_place(const Rig& rig, const PlaceAppearance& a,
                                                        const PlaceAppearance& b,
                                                        const VerificationOptions& options,
                                                        VerificationReport* report = nullptr);

}  // namespace twofold
