#pragma once

#include <vector>

#include "camera/rig.hpp"
#include "tracking/common/frame_step.hpp"
#include "tracking/common/immature_points.hpp"
#include "tracking/common/local_map.hpp"
#include "tracking/monocular/depth_seeds.hpp"
#include "tracking/options.hpp"
#include "tracking/search/local_map_search.hpp"
#include "tracking/search/point_starter.hpp"

namespace twofold {

/// Where immature points come from: corners whose depth is measured become immature points at once,
/// others wait as seeds until frames have shown how deep they are.
///
/// No allocation after construction.
class NewPoints {
 public:
  /// @param rig, fixed  must outlive this; fixed pixels of the left camera
  NewPoints(const Rig& rig, const TrackerOptions& options, const FixedPixels& fixed);

  /// Starts points in the first keyframe of a map or map part. Seeds are left to `start_seeds`.
  /// @return how many points were started
  int start_first(const FrameImages& images, KeyframeId anchor, const RollingShutter& shutter,
                  ImmaturePoints& immature_points);
  /// Starts points and seeds in a later keyframe, at corners away from the points that were found in it
  /// and, but for RGB-D, from those of the local map that are in view and were not searched, because enough
  /// others had been found.
  /// @param found  of the keyframe's frame; the candidates that its search left are taken out
  void start(const FrameImages& images, KeyframeId anchor, const LocalMap& local_map, const FrameStep& step,
             SearchOutcome& found, ImmaturePoints& immature_points);
  /// Starts seeds at corners where no point is tracked or known, and none waits for its depth. One camera
  /// has nothing else; other rigs live on them where depth is out of reach, or the right camera is covered.
  void start_seeds(const FrameImages& images, KeyframeId anchor, const RollingShutter& shutter);

  /// The same in the first keyframe of one camera's map or map part, away from the points that it starts
  /// with.
  void start_seeds_between(const FrameImages& images, KeyframeId anchor, const ImmaturePoints& points);

  /// DepthSeeds::observe.
  template <class PoseOfAnchor>
  void observe_seeds(const ImagePyramid& image, const RollingShutter& shutter, double median_depth,
                     PoseOfAnchor&& T_c_anchor, ImmaturePoints& ready) {
    seeds_.observe(image, shutter, median_depth, T_c_anchor, ready);
  }
  /// DepthSeeds::lend_rays.
  void lend_rays(double median_depth, ImmaturePoints& points) { seeds_.lend_rays(median_depth, points); }
  void forget_seeds() { seeds_.clear(); }
  [[nodiscard]] bool has_seeds() const { return seeds_.size() > 0; }

  /// PointStarter::sees_corners.
  [[nodiscard]] bool sees_corners(const ImagePyramid& image, int wanted) {
    return starter_.sees_corners(image, wanted);
  }
  /// PointStarter::explain_missing_depth.
  [[nodiscard]] LostCause explain_missing_depth(const FrameImages& images, int wanted) {
    return starter_.explain_missing_depth(images, wanted);
  }

 private:
  void occupy_unsearched(const LocalMap& local_map, const SE3& T_c_ref, Quadtree& candidates);

  const Rig& rig_;
  const NewPointOptions options_;
  PointStarter starter_;
  DepthSeeds seeds_;
  std::vector<PointAppearance> corners_;  ///< scratch
};

}  // namespace twofold
