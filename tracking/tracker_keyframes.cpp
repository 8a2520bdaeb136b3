// When a frame becomes a keyframe, and what it then hands to the map.
#include <algorithm>
#include <span>

#include "base/median.hpp"
#include "geometry/inverse_depth.hpp"
#include "imaging/image_buffers.hpp"
#include "tracking/tracker.hpp"

namespace twofold {
namespace {

constexpr std::uint32_t kRevisitInterval = 3;  // frames between looks for a better reference

}  // namespace

void Tracker::prepare(KeyframeProposal& proposal) const {
  // Every match is an observation, and a new point at most.
  proposal.observations.reserve(search_.matches.capacity());
  proposal.new_points.reserve(search_.matches.capacity());
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
  immature_points_.drop_stale(proposal.id, options_.max_failures, options_.max_immature_age);
}

/// To be done with the frame: the next one is aligned to its left image, and needs nothing else of it.
void Tracker::hand_over_images(KeyframeProposal& proposal) {
  proposal.images.left.copy_from(current_.left);
  std::swap(proposal.images.right, current_.right);
  cv::swap(proposal.images.depth, current_.depth);
  views_.add_keyframe(proposal.id, proposal.images);
}

/// Moves the reference to the keyframe of N1 that sees most of what is tracked: when the camera comes back to
/// a place, the reference comes back too, and no keyframe is needed  (thesis 6.2.2: V_ref may be an older,
/// revisited keyframe).
void Tracker::revisit_reference(const GraphSnapshot& graph) {
  if (frames_ % kRevisitInterval != 0 || !graph.contains(motion_.reference()) ||
      !immature_points_.pending().empty())
    return;
  inlier_ids_.clear();
  for (std::size_t m = 0; m < search_.matches.size(); ++m) {
    const PointId id = local_map_.points()[search_.matches[m].point].id;
    if (search_.observations[m].inlier && id != kNoPoint) inlier_ids_.push_back(id);
  }
  std::sort(inlier_ids_.begin(), inlier_ids_.end());
  const auto shared = [&](KeyframeId id) {
    int count = 0;
    for (const Observation& observation : *graph.keyframe(id).observations) {
      count += std::binary_search(inlier_ids_.begin(), inlier_ids_.end(), observation.point) ? 1 : 0;
    }
    return count;
  };
  KeyframeId best = motion_.reference();
  // Changing back and forth helps nobody: a new reference must be clearly better.
  int best_count = shared(motion_.reference()) * 6 / 5;
  for (const KeyframeId id : local_map_.neighbours()) {
    const int count = shared(id);
    if (count > best_count) {
      best = id;
      best_count = count;
    }
  }
  if (best == motion_.reference()) return;
  motion_.refer_to(best, relative_pose(graph, immature_points_, motion_.reference(), best));
}

}  // namespace twofold
