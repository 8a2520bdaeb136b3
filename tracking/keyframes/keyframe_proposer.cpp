#include "tracking/keyframes/keyframe_proposer.hpp"

#include <algorithm>
#include <bit>

namespace twofold {
namespace {

constexpr int kRegionColumns = 8;
constexpr int kRegionRows = 6;

}  // namespace

int occupied_regions(const PinholeCamera& camera, const SearchOutcome& found) {
  std::uint64_t occupied = 0;
  for (std::size_t m = 0; m < found.matches.size(); ++m) {
    if (!found.observations[m].inlier) continue;
    const StereoPixel& z = found.matches[m].found.pixel;
    const int column =
        std::clamp(static_cast<int>(z.x() * kRegionColumns / camera.width), 0, kRegionColumns - 1);
    const int row = std::clamp(static_cast<int>(z.y() * kRegionRows / camera.height), 0, kRegionRows - 1);
    occupied |= std::uint64_t{1} << (row * kRegionColumns + column);
  }
  return std::popcount(occupied);
}

void KeyframeProposer::continue_from(const GraphSnapshot& graph) {
  next_keyframe_ = static_cast<std::uint32_t>(graph.keyframe_count());
  next_point_ = static_cast<std::uint32_t>(graph.point_count());
}

bool KeyframeProposer::revisits(const SearchOutcome& found, const LocalMap& local_map) const {
  if (!one_camera_) return false;
  int inliers = 0, old = 0;
  for (std::size_t m = 0; m < found.matches.size(); ++m) {
    if (!found.observations[m].inlier) continue;
    const KeyframeId anchor = local_map.anchor(local_map.points()[found.matches[m].point]);
    ++inliers;
    old += next_keyframe_ - index(anchor) >= static_cast<std::uint32_t>(options_.keyframes.revisited_after)
               ? 1
               : 0;
  }
  return inliers > 0 && old >= options_.keyframes.revisited_share * inliers;
}

bool KeyframeProposer::due(const FrameStep& step, const TrackedView& seen,
                           const ImmaturePoints& immature_points) {
  if (one_camera_)
    last_.most_tracked = std::max(last_.most_tracked.value_or(0), reference_share(step.result));
  if (step.free_proposal == nullptr) return false;
  const KeyframeId first{first_of_part_};
  const bool one_keyframe =
      is_newest(first) && part_of(step.graph, immature_points, step.result.reference) == first;
  const KeyframeBacklog backlog{immature_points.room_for_keyframe(),
                                static_cast<int>(immature_points.pending().size()), one_keyframe};
  return step.result.by_depth
             ? keyframe_due_by_motion(step.result.T_c_ref, last_, backlog, options_.keyframes)
             : keyframe_due(step.result, last_, seen, backlog, options_.keyframes, step.bounds);
}

void KeyframeProposer::begin(const Placement& placement, const KeyframeView& view, FrameStep& step,
                             ImmaturePoints& immature_points) {
  KeyframeProposal& proposal = *step.free_proposal;
  proposal.clear();
  proposal.id = KeyframeId{next_keyframe_++};
  if (placement.reference == kNoKeyframe) first_of_part_ = index(proposal.id);
  proposal.frame_index = step.frame.index;
  proposal.t_ns = step.frame.t_ns;
  proposal.snapshot_version = step.graph.version();
  proposal.reference = placement.reference;
  proposal.T_k_ref = placement.T_c_ref;
  if (step.result.by_depth) proposal.pose_information = step.information_of_planes;
  if (step.result.by_rays) proposal.pose_information = step.result.information;
  last_ = view;
  if (one_camera_) last_.most_tracked = found_share(step.result);
  proposal.median_depth = view.median_depth;
  immature_points.add_pending({proposal.id, placement.reference, placement.T_c_ref});
  step.result.proposed = true;
}

void KeyframeProposer::add_observations(const SearchOutcome& found, const LocalMap& local_map,
                                        bool mistrusts_the_young, ImmaturePoints& immature_points,
                                        KeyframeProposal& proposal) {
  for (std::size_t m = 0; m < found.matches.size(); ++m) {
    if (!found.observations[m].inlier) continue;
    const TrackedPoint& point = local_map.points()[found.matches[m].point];
    PointId id = point.id;
    if (ImmaturePoint* immature = immature_points.at(point.immature)) {
      if (immature->is_ray()) continue;
      const bool unconfirmed = immature->id == kNoPoint;
      if (unconfirmed && mistrusts_the_young && immature->agreed < options_.immature.trusted_after) continue;
      if (unconfirmed) confirm(*immature, proposal);
      id = immature->id;
    }
    const auto level = static_cast<std::uint8_t>(found.matches[m].found.level);
    proposal.observations.push_back({id, found.observations[m].pixel, level});
  }
  std::sort(proposal.observations.begin(), proposal.observations.end(),
            [](const Observation& a, const Observation& b) { return a.point < b.point; });
}

/// An immature point was found again in a later keyframe: it gets its number and goes to the map.
void KeyframeProposer::confirm(ImmaturePoint& point, KeyframeProposal& proposal) {
  point.id = PointId{next_point_++};
  point.proposed_in = proposal.id;
  Observation anchor_observation = point.anchor_observation;
  anchor_observation.point = point.id;
  proposal.points.push_back({point.id, point.anchor, point.psi, anchor_observation, point.appearance});
}

}  // namespace twofold
