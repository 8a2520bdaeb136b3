#include <algorithm>
#include <bit>
#include <cmath>

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
  proposal.observations.reserve(matches_.capacity());
  proposal.new_points.reserve(matches_.capacity());
  allocate_images(rig_, proposal.images);
}

/// Number of parts of the image, of 8 x 6, in which a point is tracked.
int Tracker::occupied_regions() const {
  std::uint64_t occupied = 0;
  for (std::size_t m = 0; m < matches_.size(); ++m) {
    if (!motion_[m].inlier) continue;
    const Vector3& z = matches_[m].found.z;
    const int column =
        std::clamp(static_cast<int>(z.x() * kRegionColumns / rig_.camera.width), 0, kRegionColumns - 1);
    const int row =
        std::clamp(static_cast<int>(z.y() * kRegionRows / rig_.camera.height), 0, kRegionRows - 1);
    occupied |= std::uint64_t{1} << (row * kRegionColumns + column);
  }
  return std::popcount(occupied);
}

double Tracker::median_depth(const SE3& T_c_ref) {
  depths_.clear();
  for (const MotionObservation& observation : motion_) {
    if (observation.inlier) depths_.push_back((T_c_ref * observation.x_ref).z());
  }
  if (depths_.empty()) {
    for (const ImmaturePoint& point : immature_points_.points()) depths_.push_back(1.0 / point.psi.z());
  }
  const auto middle = depths_.begin() + static_cast<std::ptrdiff_t>(depths_.size() / 2);
  std::nth_element(depths_.begin(), middle, depths_.end());
  return *middle;
}

bool Tracker::keyframe_due(const TrackResult& result, const SE3& T_c_ref) const {
  if (!immature_points_.room_for_keyframe()) return false;
  const auto [begin, end] = local_map_.reference_range();
  const double visible =
      end > begin ? static_cast<double>(visible_reference_points_) / static_cast<double>(end - begin) : 0.0;
  const double share = visible * result.matches / std::max(1, result.searched);
  if (share < options_.urgent_share) return true;
  if (static_cast<int>(immature_points_.pending().size()) >= options_.max_pending) return false;
  const double parallax = T_c_ref.translation().norm() / std::max(keyframe_depth_, 1e-3);
  const bool emptied = occupied_regions() < (1 - options_.keyframe_empty) * regions_at_keyframe_;
  // The second keyframe confirms the first one's points: until then there is no map.
  const bool map_is_young =
      next_keyframe_ == first_of_part_ + 1 && parallax > 0.2 * options_.keyframe_parallax;
  if (bounds_.urgent_keyframes_only) return map_is_young;
  return parallax > options_.keyframe_parallax || share < options_.keyframe_share || emptied || map_is_young;
}

void Tracker::propose_keyframe(const Frame& frame, const GraphSnapshot& graph, KeyframeProposal& proposal,
                               TrackResult& result) {
  proposal.clear();
  proposal.id = KeyframeId{next_keyframe_};
  proposal.frame_index = frame.index;
  proposal.t_ns = frame.t_ns;
  proposal.snapshot_version = graph.version();
  proposal.reference = reference_;
  proposal.T_k_ref = result.T_c_ref;
  proposal.median_depth = keyframe_depth_ = median_depth(result.T_c_ref);
  collect_observations(proposal);
  immature_points_.add_pending({proposal.id, reference_, result.T_c_ref});
  ++next_keyframe_;
  start_points(proposal.id);
  hand_over_images(proposal);
  immature_points_.drop_stale(proposal.id, options_.max_failures, options_.max_candidate_age);
  local_map_stale_ = true;
  result.proposed = true;
}

/// To be done with the frame: the next one is aligned to its left image, and needs nothing else of it.
void Tracker::hand_over_images(KeyframeProposal& proposal) {
  proposal.images.left.copy_from(current_.left);
  std::swap(proposal.images.right, current_.right);
  cv::swap(proposal.images.depth, current_.depth);
}

void Tracker::collect_observations(KeyframeProposal& proposal) {
  for (std::size_t m = 0; m < matches_.size(); ++m) {
    if (!motion_[m].inlier) continue;
    const TrackedPoint& point = local_map_.points()[matches_[m].point];
    PointId id = point.id;
    if (point.local >= 0) {
      ImmaturePoint& local = immature_points_.points()[static_cast<std::size_t>(point.local)];
      if (local.id == kNoPoint) confirm(local, proposal);
      id = local.id;
    }
    const PointMatch& found = matches_[m].found;
    proposal.observations.push_back({id, found.z.cast<float>(), static_cast<std::uint8_t>(found.level)});
  }
  std::sort(proposal.observations.begin(), proposal.observations.end(),
            [](const Observation& a, const Observation& b) { return a.point < b.point; });
}

/// A candidate was found again in a later keyframe: it gets its number and goes to the map.
void Tracker::confirm(ImmaturePoint& point, KeyframeProposal& proposal) {
  point.id = PointId{next_point_++};
  point.proposed_in = proposal.id;
  Observation anchor_observation = point.anchor_observation;
  anchor_observation.point = point.id;
  proposal.new_points.push_back({point.id, point.anchor, point.psi, anchor_observation, point.appearance});
}

/// New points where nothing is tracked.
void Tracker::start_points(KeyframeId anchor) {
  starter_.clear();
  for (std::size_t m = 0; m < matches_.size(); ++m) {
    if (motion_[m].inlier) starter_.occupy(matches_[m].found.z.head<2>().cast<float>());
  }
  starter_.start(current_, anchor, immature_points_);
  regions_at_keyframe_ = occupied_regions();
}

/// Moves the reference to the keyframe of N1 that sees most of what is tracked: when the camera comes back to
/// a place, the reference comes back too, and no keyframe is needed  (thesis 6.2.2: V_ref may be an older,
/// revisited keyframe).
void Tracker::revisit_reference(const GraphSnapshot& graph) {
  if (frames_ % kRevisitInterval != 0 || !graph.contains(reference_) || !immature_points_.pending().empty())
    return;
  inlier_ids_.clear();
  for (std::size_t m = 0; m < matches_.size(); ++m) {
    const PointId id = local_map_.points()[matches_[m].point].id;
    if (motion_[m].inlier && id != kNoPoint) inlier_ids_.push_back(id);
  }
  std::sort(inlier_ids_.begin(), inlier_ids_.end());
  const auto shared = [&](KeyframeId id) {
    int count = 0;
    for (const Observation& observation : *graph.keyframe(id).observations) {
      count += std::binary_search(inlier_ids_.begin(), inlier_ids_.end(), observation.point) ? 1 : 0;
    }
    return count;
  };
  KeyframeId best = reference_;
  // Changing back and forth helps nobody: a new reference must be clearly better.
  int best_count = shared(reference_) * 6 / 5;
  for (const KeyframeId id : local_map_.neighbours()) {
    const int count = shared(id);
    if (count > best_count) {
      best = id;
      best_count = count;
    }
  }
  if (best == reference_) return;
  T_prev_ref_ = T_prev_ref_ * relative_pose(graph, immature_points_, reference_, best);
  reference_ = best;
  local_map_stale_ = true;
}

}  // namespace twofold
