// When a frame becomes a keyframe, and what it then hands to the map.
#include <span>

#include "base/median.hpp"
#include "geometry/inverse_depth.hpp"
#include "imaging/image_buffers.hpp"
#include "tracking/tracker.hpp"

namespace twofold {

void Tracker::prepare(KeyframeProposal& proposal) const {
  // Every match is an observation, and a new point at most.
  proposal.observations.reserve(search_.matches.capacity());
  proposal.points.reserve(search_.matches.capacity());
  allocate_images(rig_, proposal.images);
}

/// Of what is tracked, or else of points that were just started [m].
double Tracker::median_depth(const SE3& T_c_ref) {
  samples_.clear();
  for (const MotionObservation& observation : search_.observations) {
    if (observation.inlier) samples_.push_back((T_c_ref * observation.x_ref).z());
  }
  if (samples_.empty()) {
    for (const ImmaturePoint& point : immature_points_.points()) samples_.push_back(1.0 / point.psi.z());
  }
  return median(std::span(samples_));
}

/// What says, beside its pose, whether this frame should become a keyframe.
TrackedView Tracker::tracked_view() const {
  return {occupied_regions(rig_.camera, search_), proposer_.revisits(search_, local_map_),
          pose_estimator_.mistrusts_the_young()};
}

/// What later frames are judged by if this one becomes a keyframe.
KeyframeView Tracker::view_of(const FrameStep& step) {
  const double depth =
      step.result.by_depth ? depth_alignment_->typical_depth() : median_depth(step.result.T_c_ref);
  return {depth, occupied_regions(rig_.camera, search_)};
}

void Tracker::propose_keyframe(FrameStep& step) {
  KeyframeProposal& proposal = *step.free_proposal;
  proposer_.begin({step.result.reference, step.result.T_c_ref}, view_of(step), step, immature_points_);
  // Where corners are few, most lie on bare edges, along which they slide: the map takes none of them.
  if (!step.result.by_depth)
    proposer_.add_observations(search_, local_map_, pose_estimator_.mistrusts_the_young(), immature_points_,
                               proposal);
  new_points_.start(current_, proposal.id, local_map_, step, search_, immature_points_);
  correction_.look_at_keyframe(current_);
  hand_over_images(proposal);
  const int max_age =
      rig_.kind == SensorKind::kMono ? options_.immature.max_age_of_one_camera : options_.immature.max_age;
  immature_points_.drop_stale(proposal.id, options_.immature.max_failures, max_age);
}

/// To be done with the frame: the next one is aligned to its left image, and needs nothing else of it.
void Tracker::hand_over_images(KeyframeProposal& proposal) {
  proposal.images.left.copy_from(current_.left);
  std::swap(proposal.images.right, current_.right);
  cv::swap(proposal.images.depth, current_.depth);
  views_.add_keyframe(proposal.id, proposal.images);
}

void Tracker::revisit_reference(const GraphSnapshot& graph) {
  if (!graph.contains(motion_.reference()) || !immature_points_.pending().empty()) return;
  const auto better = reference_choice_.better(graph, motion_.reference(), local_map_, search_);
  if (better)
    motion_.refer_to(*better, pose_relative_to(graph, immature_points_, motion_.reference(), *better));
}

}  // namespace twofold
