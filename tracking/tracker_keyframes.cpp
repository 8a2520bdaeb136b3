// When a frame becomes a keyframe, and what it then hands to the map.
#include <algorithm>
#include <bit>
#include <cmath>
#include <span>

#include "base/median.hpp"
#include "geometry/inverse_depth.hpp"
#include "imaging/image_buffers.hpp"
#include "tracking/tracker.hpp"

namespace twofold {
namespace {

constexpr int kRegionColumns = 8;
constexpr int kRegionRows = 6;
constexpr std::uint32_t kRevisitInterval = 3;  // frames between looks for a better reference

}  // namespace

void Tracker::prepare(KeyframeProposal& proposal) const {
  // Every match is an observation, and a new point at most.
  proposal.observations.reserve(search_.matches.capacity());
  proposal.new_points.reserve(search_.matches.capacity());
  allocate_images(rig_, proposal.images);
}

/// Number of parts of the image, of 8 x 6, in which a point is tracked.
int Tracker::occupied_regions() const {
  std::uint64_t occupied = 0;
  for (std::size_t m = 0; m < search_.matches.size(); ++m) {
    if (!search_.observations[m].inlier) continue;
    const Vector3& z = search_.matches[m].found.z;
    const int column =
        std::clamp(static_cast<int>(z.x() * kRegionColumns / rig_.camera.width), 0, kRegionColumns - 1);
    const int row =
        std::clamp(static_cast<int>(z.y() * kRegionRows / rig_.camera.height), 0, kRegionRows - 1);
    occupied |= std::uint64_t{1} << (row * kRegionColumns + column);
  }
  return std::popcount(occupied);
}

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

bool Tracker::keyframe_is_due(const FrameStep& step) const {
  if (step.free_proposal == nullptr) return false;
  const bool one_keyframe =
      next_.keyframe == next_.first_of_part + 1 && part(step) == KeyframeId{next_.first_of_part};
  const KeyframeBacklog backlog{immature_points_.room_for_keyframe(),
                                static_cast<int>(immature_points_.pending().size()), one_keyframe};
  return step.result.by_depth
             ? keyframe_due_by_motion(step.result.T_c_ref, last_keyframe_, backlog, options_)
             : keyframe_due(step.result, last_keyframe_, occupied_regions(), backlog, options_, step.bounds);
}

void Tracker::propose_keyframe(FrameStep& step) {
  KeyframeProposal& proposal = *step.free_proposal;
  last_keyframe_.median_depth =
      step.result.by_depth ? depth_alignment_->typical_depth() : median_depth(step.result.T_c_ref);
  begin_proposal({step.result.reference, step.result.T_c_ref}, step);
  // Where corners are few, most lie on bare edges, along which they slide: the map takes none of them.
  if (!step.result.by_depth) collect_observations(proposal);
  new_points_.start(current_, proposal.id, local_map_, step, search_, immature_points_);
  last_keyframe_.occupied_regions = occupied_regions();
  correction_.look_at_keyframe(current_);
  hand_over_images(proposal);
  immature_points_.drop_stale(proposal.id, options_.max_failures, options_.max_immature_age);
}

/// Numbers the keyframe, whose pose relative to its reference is `placement`.
void Tracker::begin_proposal(const Placement& placement, FrameStep& step) {
  KeyframeProposal& proposal = *step.free_proposal;
  proposal.clear();
  proposal.id = KeyframeId{next_.keyframe++};
  proposal.frame_index = step.frame.index;
  proposal.t_ns = step.frame.t_ns;
  proposal.snapshot_version = step.graph.version();
  proposal.reference = placement.reference;
  proposal.T_k_ref = placement.T_c_ref;
  if (step.result.by_depth) proposal.pose_information = step.information_of_planes;
  proposal.median_depth = last_keyframe_.median_depth;
  immature_points_.add_pending({proposal.id, placement.reference, placement.T_c_ref});
  step.result.proposed = true;
}

/// To be done with the frame: the next one is aligned to its left image, and needs nothing else of it.
void Tracker::hand_over_images(KeyframeProposal& proposal) {
  proposal.images.left.copy_from(current_.left);
  std::swap(proposal.images.right, current_.right);
  cv::swap(proposal.images.depth, current_.depth);
  views_.add_keyframe(proposal.id, proposal.images);
}

void Tracker::collect_observations(KeyframeProposal& proposal) {
  for (std::size_t m = 0; m < search_.matches.size(); ++m) {
    if (!search_.observations[m].inlier) continue;
    const TrackedPoint& point = local_map_.points()[search_.matches[m].point];
    PointId id = point.id;
    if (ImmaturePoint* immature = immature_points_.at(point.immature)) {
      if (immature->id == kNoPoint && pose_estimator_.mistrusts_the_young() &&
          immature->agreed < options_.trusted_after) {
        continue;  // chance finds what moves near where it was
      }
      if (immature->id == kNoPoint) confirm(*immature, proposal);
      id = immature->id;
    }
    const auto level = static_cast<std::uint8_t>(search_.matches[m].found.level);
    proposal.observations.push_back({id, search_.observations[m].z, level});
  }
  std::sort(proposal.observations.begin(), proposal.observations.end(),
            [](const Observation& a, const Observation& b) { return a.point < b.point; });
}

/// An immature point was found again in a later keyframe: it gets its number and goes to the map.
void Tracker::confirm(ImmaturePoint& point, KeyframeProposal& proposal) {
  point.id = PointId{next_.point++};
  point.proposed_in = proposal.id;
  Observation anchor_observation = point.anchor_observation;
  anchor_observation.point = point.id;
  proposal.new_points.push_back({point.id, point.anchor, point.psi, anchor_observation, point.appearance});
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
