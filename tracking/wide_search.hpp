#pragma once

#include <optional>
#include <span>
#include <string>
#include <vector>

#include "camera/rig.hpp"
#include "estimation/motion_only.hpp"
#include "estimation/pose_consensus.hpp"
#include "imaging/guided_search.hpp"
#include "imaging/image_pyramid.hpp"
#include "tracking/dense_alignment.hpp"

namespace twofold {

struct WideSearchOptions {
  int level = 2;            ///< of the pyramids: patches of 8 of its pixels, wide enough to be told apart
  float min_deviation = 6;  ///< of a patch worth looking for [grey]
  double max_cost_ratio = 0.95;  ///< least cost to the least one elsewhere
  int min_agreeing = 10;         ///< points that the motion must explain
  PoseConsensusOptions consensus;
  MotionOnlyOptions refinement;

  /// Empty when valid; otherwise names the field, the rule and the value.
  [[nodiscard]] std::string invalid_reason() const;
};

/// Finds the camera again after a step that was too wide for the guided search. Points of the last good frame
/// are looked for in the whole of a coarse level, without any prediction; those found that have depth in
/// both frames give the motion that most of them agree on (three-point RANSAC), which is rough: a guided
/// search from there decides.
///
/// Work is bounded by points and pixels of the level. No allocation after construction.
class WideSearch {
 public:
  WideSearch(const Rig& rig, std::size_t capacity, const WideSearchOptions& options);

  /// @param points  at most `capacity` are used
  /// @return T_cur_prev; nothing when too few points agree on one
  [[nodiscard]] std::optional<SE3> find(const ImagePyramid& previous, const FrameImages& current,
                                        std::span<const AlignmentPoint> points,
                                        const GuidedSearchOptions& search);

 private:
  [[nodiscard]] std::optional<Vector3> find_one(const ImagePyramid& previous, const FrameImages& current,
                                                const AlignmentPoint& point,
                                                const GuidedSearchOptions& search) const;
  [[nodiscard]] std::optional<Eigen::Vector2i> best_place(const Patch& patch, const cv::Mat& image) const;

  Rig rig_;
  WideSearchOptions options_;
  std::vector<MotionObservation> found_;
  PoseConsensus consensus_;
};

}  // namespace twofold
