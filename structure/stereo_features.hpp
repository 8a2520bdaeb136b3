#pragma once

#include <vector>

#include "camera/measurement.hpp"
#include "camera/rig.hpp"
#include "geometry/consistent_matches.hpp"
#include "imaging/image_pyramid.hpp"
#include "imaging/patch.hpp"
#include "structure/options.hpp"

namespace twofold {

/// A corner of the left image found again in the right one.
struct StereoFeature {
  StereoPixel pixel;  ///< u_l, v_l whole
  Patch patch;
  float score = 0;  ///< of the corner
};

/// Corners spread over the image, at most one a cell, with their stereo matches.
[[nodiscard]] std::vector<StereoFeature> find_stereo_features(const FrameImages& images, const Rig& rig,
                                                              const StructureOptions& options);

/// Covariance in the camera's frame of a point from its stereo measurement, sigma_px on every component
/// [m^2].
[[nodiscard]] Matrix3 stereo_covariance(const Rig& rig, const StereoPixel& z, double sigma_px);

struct FeatureMatch {
  int previous = 0, current = 0;  ///< indices into the two frames' features
};

/// All pairs within reach by the sum of absolute differences of 8x8 patches without their means; kept when
/// best in both directions and clearly better than the second  (SWF 4.1.1).
[[nodiscard]] std::vector<FeatureMatch> match_features(const std::vector<StereoFeature>& previous,
                                                       const std::vector<StereoFeature>& current,
                                                       double reach_px, double max_ratio);

/// The part of the matches that moves as one rigid body: Moravec's check on their stereo positions.
[[nodiscard]] std::vector<FeatureMatch> consistent_feature_matches(const std::vector<StereoFeature>& previous,
                                                                   const std::vector<StereoFeature>& current,
                                                                   const std::vector<FeatureMatch>& matches,
                                                                   const Rig& rig,
                                                                   const StructureOptions& options);

}  // namespace twofold
