#pragma once

#include <span>
#include <string>
#include <vector>

#include "estimation/motion_only.hpp"
#include "graph/neighbourhood.hpp"
#include "graph/snapshot.hpp"
#include "imaging/image_pyramid.hpp"

namespace twofold {

struct RefinementOptions {
  int neighbours = 8;    ///< keyframes of N1 whose points are looked for, the place itself included, >= 1
  int max_points = 400;  ///< searched, >= min_visible
  int min_visible = 40;  ///< points that should be in view, >= 1; fewer say nothing
  double border_px = 8;  ///< a point nearer than this to the image's border is not looked for, >= 0
  double radius_px = 8;  ///< of the first search, pixels of the searched level, > 0
  double second_radius_px = 8.0 / 3;  ///< of the second one, from the pose the first one found, > 0
  int min_inliers = 20;               ///< points, >= 3
  double min_inlier_share = 0.6;      ///< of the points found, in [0, 1]
  double min_visible_share = 0.1;     ///< ... and of those looked for, in [0, 1]: the others should be seen
                                      ///< and are not
  /// Far below a hundredth of a pixel the iterations need not settle: with many outliers they take long to.
  MotionOnlyOptions solver{.max_iterations = 15, .stop_step = 1e-5};

  /// Empty when valid; otherwise names the field, the rule and the value.
  [[nodiscard]] std::string invalid_reason() const;
};

/// A view placed by the map's points.
struct RefinedPlace {
  SE3 T_c_k;
  int inliers = 0;
  /// Sum over the inliers of how well each one's position is known from here: 1 if its error projects to no
  /// more than pixels' noise, as of a point that both keyframes of an edge measure (edge_information);
  /// towards 0 where its depth shifts it by more.
  int weight = 1;
  /// Standard deviation of the position [m], by the inliers; their errors are taken as independent of each
  /// other, and the poses around the place as true.
  double sigma = 0;
};

enum class RefinementOutcome : std::uint8_t {
  kRefined,
  kTooFewPoints,  ///< the map knows fewer than min_visible points that should be seen: nothing can be said
  kContradicted   ///< they should be seen, but too few are found where they should be
};

/// Looks for the map's points around a keyframe in a view whose place was recognised. Their patches, and
/// depths estimated from many frames, give the pose far more exactly than described corners with depths from
/// one frame; and they are evidence that does not depend on the descriptors. Seen from the side, a depth's
/// error shifts a point: each is weighed by how well it is known from here.
class PoseRefinement {
 public:
  PoseRefinement(const Rig& rig, const RefinementOptions& options) : rig_(rig), options_(options) {}

  /// @param T_c_k   pose of the view relative to keyframe `place`, about right
  /// @param result  of kRefined; overwritten by the other outcomes
  [[nodiscard]] RefinementOutcome refine(const GraphSnapshot& graph, KeyframeId place,
                                         const FrameImages& images, const SE3& T_c_k, RefinedPlace& result);
  /// What it found when it last refined a place, points in the place's frame; outliers included.
  [[nodiscard]] std::span<const MotionObservation> found() const { return found_; }

 private:
  void collect_points(const GraphSnapshot& graph, KeyframeId place, const SE3& T_c_k);
  void search(const GraphSnapshot& graph, KeyframeId place, const FrameImages& images, const SE3& T_c_k,
              double radius_px);
  /// What a point's measurement tells of a pose: the diagonal of (Omega^-1 + J P J^T)^-1, P its position's
  /// covariance; correlations of u, v, and u_r are left out.
  [[nodiscard]] Eigen::Vector3f information(const GraphSnapshot& graph, PointId id, const SE3& T_c_w,
                                            const Eigen::Vector3f& of_pixels) const;
  [[nodiscard]] int weight_of_inliers() const;

  Rig rig_;
  RefinementOptions options_;
  std::vector<KeyframeId> keyframes_;
  std::vector<PointId> visible_;
  VisitedSet visited_;
  std::vector<MotionObservation> found_;
  std::vector<float> known_;  ///< of each that was found, what it adds to RefinedPlace::weight: (0, 1]
};

}  // namespace twofold
