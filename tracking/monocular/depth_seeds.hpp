#pragma once

#include <algorithm>
#include <cstdint>
#include <string>
#include <vector>

#include "camera/rig.hpp"
#include "camera/rolling_shutter.hpp"
#include "filters/inverse_depth_filter.hpp"
#include "imaging/epipolar_search.hpp"
#include "imaging/point_appearance.hpp"
#include "tracking/common/immature_points.hpp"

namespace twofold {

struct DepthSeedOptions {
  int max_observed = 300;         ///< filters updated in one frame, >= 1
  double min_depth_share = 0.25;  ///< of the scene's median depth: nothing nearer is looked for, > 0
  EpipolarSearchOptions line;
  /// Of the epipolar line, on the level searched: below it nothing is learnt of an unknown depth, >= 0 [px].
  float min_stretch_px = 2;
  double range_sigmas = 3;  ///< half of the stretch searched once something is known, > 0
  double min_gain = 0.5;    ///< share of what is known of the depth that another look must add, > 0
  /// Later frames that must have seen a point before it is used, >= 1; the keyframe that brings it into the
  /// map is one more.
  int min_looks = 1;
  double near_error = 0.12;         ///< of inverse depth, as a share of it, with which a point is used, > 0
  double far_error = 0.02;          ///< the same times the scene's median depth, for points at infinity, >= 0
  int max_misses = 3;               ///< looks in a row without a match after which a seed is given up, >= 1
  int max_first_misses = 2;         ///< the same of a seed that no later frame has seen yet, >= 1
  int max_age = 6;                  ///< keyframes after which it is given up, >= 1
  int filter_iterations = 5;        ///< of the update with one frame, >= 1
  double min_inverse_depth = 1e-3;  ///< that of a point at infinity, in 1 / median depth, > 0
  double unknown_sigma = 0.7;       ///< of an inverse depth that nobody knows, in 1 / median depth, > 0

  /// Empty when valid; otherwise names the field, the rule and the value.
  [[nodiscard]] std::string invalid_reason() const;
};

/// Corners of keyframes whose depth is not known yet: each has an information filter of its own, which begins
/// with no depth at all, and is updated with every frame whose pose is known (thesis 3.4.4). Given that pose
/// they are independent. Where rows are read one after the other, a seed's own frame is the camera as it was
/// when the corner's row was exposed: as long as its depth is not known, it cannot be moved to mid-exposure.
/// What is known well enough becomes an ImmaturePoint: the tracker uses it at once, and the map adjusts it
/// jointly when the next keyframe has found it.
///
/// Never grows beyond its capacity; work per frame is bounded by the options.
class DepthSeeds {
 public:
  DepthSeeds(const Rig& rig, const GuidedSearchOptions& search, const DepthSeedOptions& options,
             std::size_t capacity);

  void clear() { seeds_.clear(); }
  /// A corner of keyframe `anchor`; dropped when there is no room.
  /// @param shutter  of that keyframe
  void add(KeyframeId anchor, const PointAppearance& appearance, const RollingShutter& shutter);
  /// Gives up seeds that are too old by now; to be called before those of the newest keyframe are added.
  void begin_keyframe(KeyframeId newest);

  /// What the frame says about depths.
  /// @param shutter       of the frame
  /// @param T_c_anchor    callable: pose of the frame relative to keyframe `id`
  /// @param median_depth  of what is tracked
  /// @param ready         takes the points that can be used from now on
  template <class PoseOfAnchor>
  void observe(const ImagePyramid& images, const RollingShutter& shutter, double median_depth,
               PoseOfAnchor&& T_c_anchor, ImmaturePoints& ready);

  /// Lends all seeds as rays (ImmaturePoint::is_ray): where the map has too few points in view, corners whose
  /// depth nobody knows yet say how the camera turns. They follow their seeds, and become points in their
  /// place when these know their depth.
  void lend_rays(double median_depth, ImmaturePoints& points);

  /// visit(level-0 pixel) for each seed, where it was seen last.
  template <class Visit>
  void for_places(Visit&& visit) const {
    for (const Seed& seed : seeds_) visit(seed.uv);
  }
  [[nodiscard]] std::size_t size() const { return seeds_.size(); }

 private:
  struct Seed {
    KeyframeId anchor = kNoKeyframe;
    PointAppearance appearance;
    RollingShutter shutter;     ///< of the anchor
    InverseDepthFilter filter;  ///< in the frame of the corner's row
    Eigen::Vector2f uv{0, 0};   ///< where it was seen last
    std::uint32_t number = 0;   ///< ascending
    bool lent = false;          ///< as a ray
    std::uint8_t looks = 0;     ///< frames that saw it
    std::uint8_t misses = 0;    ///< looks in a row that did not find it
  };

  [[nodiscard]] bool known(const Seed& seed) const { return seed.looks > 0; }
  [[nodiscard]] InverseDepthRange range_of(const Seed& seed, double median_depth) const;
  [[nodiscard]] SE3 T_anchor_row(const Seed& seed) const;
  [[nodiscard]] bool worth_a_look(const Seed& seed, const EpipolarStretch& stretch, const SE3& T_c_row) const;
  void look(Seed& seed, const ImagePyramid& images, const RollingShutter& shutter, const SE3& T_c_a,
            double median_depth) const;
  [[nodiscard]] bool mature(const Seed& seed, double median_depth) const;
  [[nodiscard]] ImmaturePoint point_of(const Seed& seed, double median_depth) const;
  [[nodiscard]] ImmaturePoint ray_of(const Seed& seed, double median_depth) const;
  [[nodiscard]] bool hand_over(const Seed& seed, double median_depth, ImmaturePoints& ready) const;
  void update_rays(double median_depth, ImmaturePoints& points);
  void keep_immature(double median_depth, ImmaturePoints& ready);

  Rig rig_;
  GuidedSearchOptions search_;
  DepthSeedOptions options_;
  KeyframeId newest_ = kNoKeyframe;
  std::vector<Seed> seeds_;  ///< by anchor and number
  std::uint32_t last_number_ = 0;
  std::size_t next_ = 0;  ///< where the next frame begins, when one does not get round
};

template <class PoseOfAnchor>
void DepthSeeds::observe(const ImagePyramid& images, const RollingShutter& shutter, double median_depth,
                         PoseOfAnchor&& T_c_anchor, ImmaturePoints& ready) {
  const std::size_t count = std::min(seeds_.size(), static_cast<std::size_t>(options_.max_observed));
  KeyframeId anchor = kNoKeyframe;
  SE3 T_c_a;
  for (std::size_t n = 0; n < count; ++n, ++next_) {
    if (next_ >= seeds_.size()) next_ = 0;
    Seed& seed = seeds_[next_];
    if (seed.anchor != anchor) T_c_a = T_c_anchor(anchor = seed.anchor);
    look(seed, images, shutter, T_c_a, median_depth);
  }
  keep_immature(median_depth, ready);
}

}  // namespace twofold
