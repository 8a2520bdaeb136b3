#pragma once

#include <vector>

#include "graph/keyframe.hpp"
#include "imaging/image_pyramid.hpp"
#include "imaging/point_appearance.hpp"

namespace twofold {

/// A point that was started in keyframe `anchor` and found again in the proposed keyframe: it may join the
/// map (6.3). Its measurement in the proposed keyframe is among KeyframeProposal::observations.
struct ProposedPoint {
  PointId id = kNoPoint;
  KeyframeId anchor = kNoKeyframe;
  Vector3 psi{0, 0, 1};  ///< in the anchor's frame
  Observation anchor_observation;
  PointAppearance appearance;
};

/// Message of the tracker to the mapper: a frame that should become keyframe `id`. Self-contained; pooled, so
/// clear() keeps capacities and image buffers.
struct KeyframeProposal {
  KeyframeId id = kNoKeyframe;
  std::int64_t frame_index = 0;
  std::int64_t t_ns = 0;
  std::uint64_t snapshot_version = 0;  ///< version it was tracked against
  KeyframeId reference =
      kNoKeyframe;  ///< kNoKeyframe for the first keyframe of a map (part): T_k_ref is then T_k_w
  SE3 T_k_ref;      ///< pose relative to the reference keyframe, or to an earlier proposal
  /// Of T_k_ref, left perturbation (v, omega), when that was measured as a whole and does not rest on the
  /// observations alone (a depth camera before bare walls); else zero.
  Matrix6 pose_information = Matrix6::Zero();
  double median_depth = 0;            ///< [m]
  ObservationList observations;       ///< of map points and of `points`, ascending by point
  std::vector<ProposedPoint> points;  ///< ascending by id
  FrameImages images;

  void clear();
};

}  // namespace twofold
