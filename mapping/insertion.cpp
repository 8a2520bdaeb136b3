#include "mapping/insertion.hpp"

#include <algorithm>
#include <cmath>

namespace twofold {
namespace {

bool measured(const Observation& observation) {
  return std::isfinite(observation.pixel.x()) && std::isfinite(observation.pixel.y());
}

const Observation* observation_of(const KeyframeProposal& proposal, PointId point) {
  const auto& list = proposal.observations;
  const auto at = std::lower_bound(list.begin(), list.end(), point,
                                   [](const Observation& o, PointId p) { return o.point < p; });
  return at != list.end() && at->point == point ? &*at : nullptr;
}

/// The reference, or the keyframe that stands for it, and the new keyframe's pose relative to that.
std::pair<KeyframeId, SE3> live_reference(const GraphSnapshot& graph, const KeyframeProposal& proposal) {
  const auto live = graph.live_replacement(proposal.reference);
  TWOFOLD_CHECK(live, "the reference of a proposal was culled too long ago");
  return {live->id, proposal.T_k_ref * live->T_this_live};
}

void add_keyframe(GraphWriter& writer, const KeyframeProposal& proposal, const SE3& T_k_w, KeyframeId part) {
  Keyframe keyframe;
  keyframe.id = proposal.id;
  keyframe.frame_index = proposal.frame_index;
  keyframe.t_ns = proposal.t_ns;
  keyframe.T_k_w = T_k_w;
  keyframe.median_depth = proposal.median_depth;
  keyframe.part = part;
  writer.add_keyframe(std::move(keyframe));
}

/// A new point joins with both its observations, if its anchor is still there and it was found again.
int add_new_points(GraphWriter& writer, const KeyframeProposal& proposal) {
  int added = 0;
  std::vector<std::pair<KeyframeId, Observation>> anchor_observations;
  for (const ProposedPoint& point : proposal.points) {
    const GraphSnapshot& graph = writer.graph();
    if (index(point.id) < graph.point_count() || !graph.contains(point.anchor)) continue;
    if (graph.keyframe(point.anchor).culled() || point.anchor == proposal.id) continue;
    if (graph.part(point.anchor) != graph.part(proposal.id)) continue;
    if (!point.psi.allFinite() || !(point.psi.z() > 0) || !measured(point.anchor_observation)) continue;
    const Observation* found = observation_of(proposal, point.id);
    if (!found || !measured(*found)) continue;
    MapPoint map_point;
    map_point.anchor = point.anchor;
    map_point.psi = point.psi;
    map_point.appearance = std::make_shared<const PointAppearance>(point.appearance);
    writer.add_point(point.id, std::move(map_point));
    anchor_observations.emplace_back(point.anchor, point.anchor_observation);
    anchor_observations.back().second.point = point.id;
    ++added;
  }
  // By anchor: a keyframe's list is rebuilt once, not once a point.
  std::stable_sort(anchor_observations.begin(), anchor_observations.end(),
                   [](const auto& a, const auto& b) { return a.first < b.first; });
  std::vector<Observation> group;
  for (std::size_t n = 0; n < anchor_observations.size(); ++n) {
    group.push_back(anchor_observations[n].second);
    const bool last = n + 1 == anchor_observations.size();
    if (!last && anchor_observations[n + 1].first == anchor_observations[n].first) continue;
    writer.add_observations(anchor_observations[n].first, group);
    group.clear();
  }
  return added;
}

void add_proposed_observations(GraphWriter& writer, const KeyframeProposal& proposal,
                               InsertionReport& report) {
  std::vector<Observation> accepted;
  accepted.reserve(proposal.observations.size());
  for (const Observation& observation : proposal.observations) {
    const GraphSnapshot& graph = writer.graph();
    const bool is_there = graph.contains(observation.point) && !graph.point(observation.point).culled();
    const bool here =
        is_there && graph.part(graph.point(observation.point).anchor) == graph.part(proposal.id);
    if (here && measured(observation)) {
      accepted.push_back(observation);
    } else {
      ++report.dropped_observations;
    }
  }
  writer.add_observations(proposal.id, accepted);
  report.observations = static_cast<int>(accepted.size());
}

/// Edges to all of `reachable` that share min_covisible points, or to the strongest of them, or to
/// `reference`.
int add_covisibility_edges(GraphWriter& writer, KeyframeId id, KeyframeId reference, int min_covisible,
                           const IdMap& reachable, IdMap& counts) {
  std::vector<Covisible> covisible;
  covisible_keyframes(writer.graph(), id, counts, covisible);
  Covisible strongest{reference, 0};
  int edges = 0;
  for (const Covisible& other : covisible) {
    if (!reachable.contains(other.id)) continue;
    if (other.points > strongest.points) strongest = other;
    if (other.points < min_covisible) continue;
    link(writer, id, other.id, other.points);
    ++edges;
  }
  if (edges > 0) return edges;
  link(writer, id, strongest.id, std::max(1, strongest.points));
  return 1;
}

}  // namespace

InsertionReport insert_keyframe(GraphWriter& writer, const KeyframeProposal& proposal, int min_covisible,
                                IdMap& consistent, IdMap& counts) {
  InsertionReport report;
  const bool first_of_part = proposal.reference == kNoKeyframe;
  KeyframeId reference = kNoKeyframe;
  SE3 T_k_w = proposal.T_k_ref;
  if (!first_of_part) {
    TWOFOLD_CHECK(writer.graph().contains(proposal.reference), "a proposal refers to a known keyframe");
    SE3 T_k_ref;
    std::tie(reference, T_k_ref) = live_reference(writer.graph(), proposal);
    T_k_w = T_k_ref * writer.graph().keyframe(reference).T_k_w;
  }
  const KeyframeId part = first_of_part ? proposal.id : writer.graph().keyframe(reference).part;
  add_keyframe(writer, proposal, T_k_w, part);
  report.new_points = add_new_points(writer, proposal);
  add_proposed_observations(writer, proposal, report);
  if (first_of_part || !consistent.contains(reference)) {
    consistent.clear();
    if (!first_of_part) consistent.set(reference, 0);
  }
  if (!first_of_part) {
    report.edges = add_covisibility_edges(writer, proposal.id, reference, min_covisible, consistent, counts);
  }
  consistent.set(proposal.id, 0);
  writer.set_reference(proposal.id);
  return report;
}

bool keep_measured_pose(GraphWriter& writer, const KeyframeProposal& proposal, const Rig& rig,
                        const MapperOptions& options) {
  if (proposal.reference == kNoKeyframe || proposal.pose_information.isZero(0)) return false;
  const GraphSnapshot& graph = writer.graph();
  const auto [reference, T_k_ref] = live_reference(graph, proposal);
  const Keyframe &keyframe = graph.keyframe(proposal.id), &other = graph.keyframe(reference);
  if (shared_points(keyframe, other) >= options.min_covisible) return false;
  const int weight = weight_of_measured_pose(proposal.pose_information, keyframe, other, rig, options.edge);
  link_marginalised(writer, proposal.id, reference, weight, T_k_ref.inverse());
  return true;
}

int register_in_window(GraphWriter& writer, KeyframeId id, const DoubleWindow& window, int min_covisible,
                       IdMap& counts) {
  if (!window.contains(id)) return 0;
  std::vector<Covisible> covisible;
  covisible_keyframes(writer.graph(), id, counts, covisible);
  int added = 0;
  for (const auto& [other, points] : covisible) {
    if (points < min_covisible || !window.contains(other)) continue;
    if (find_edge(writer.graph().keyframe(id), other)) continue;
    if (window.is_inner(id) || window.is_inner(other)) {
      link(writer, id, other, points);
    } else {
      const SE3 T_other_id =
          writer.graph().keyframe(other).T_k_w * writer.graph().keyframe(id).T_k_w.inverse();
      link_marginalised(writer, id, other, points, T_other_id);
    }
    ++added;
  }
  return added;
}

}  // namespace twofold
