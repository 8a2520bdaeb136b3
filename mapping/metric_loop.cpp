#include "mapping/metric_loop.hpp"

#include <algorithm>
#include <cmath>

#include "camera/image_halves.hpp"
#include "camera/measurement.hpp"
#include "geometry/inverse_depth.hpp"
#include "graph/way_length.hpp"
#include "imaging/view_change.hpp"
#include "mapping/edges.hpp"
#include "mapping/mapper_hook.hpp"

namespace twofold {

PointSearch guided_point_search(const Rig& rig, double radius_px) {
  GuidedSearchOptions options;
  options.radius_px = radius_px;
  return [rig, options](const FrameImages& images, PointId, const MapPoint& point, const SE3& T_k_a) {
    return point.appearance ? find_point(images, rig, *point.appearance, point.psi, T_k_a, options)
                            : std::nullopt;
  };
}

MetricLoopReport& MetricLoopReport::operator+=(const MetricLoopReport& other) {
  searched += other.searched;
  found += other.found;
  agreed += other.agreed;
  edges += other.edges;
  observations += other.observations;
  return *this;
}

MetricLoopCloser::MetricLoopCloser(const Rig& rig, const MapperOptions& options, PointSearch search)
    : rig_(rig),
      min_matches_(options.min_covisible),
      scale_drifts_(scale_drifts(rig, options)),
      options_(options.loop),
      search_(std::move(search)) {}

MetricLoopReport MetricLoopCloser::close(GraphWriter& writer, const DoubleWindow& window, KeyframeId keyframe,
                                         const FrameImages& images) {
  MetricLoopReport report;
  reference_ = keyframe;
  split_neighbourhoods(writer.graph(), window);
  if (far_.empty()) return report;
  collect_candidates(writer.graph());
  report.searched = static_cast<int>(candidates_.size());
  if (report.searched < min_matches_) return report;
  search_candidates(writer.graph(), images);
  report.found = static_cast<int>(found_.size());
  if (report.found < min_matches_) return report;
  const auto T_loop_w = estimate_pose(writer.graph().keyframe(reference_).T_k_w);
  if (!T_loop_w) return report;
  prune(*T_loop_w);
  report.agreed = static_cast<int>(found_.size());
  if (report.agreed < min_matches_) return report;
  connect(writer, *T_loop_w, report);
  return report;
}

void MetricLoopCloser::split_neighbourhoods(const GraphSnapshot& graph, const DoubleWindow& window) {
  near_.clear();
  far_.clear();
  direct_neighbours(graph, reference_, graph.keyframe(reference_).edges->size() + 1, near_);  // eq. 6.5
  const std::size_t count = std::min(static_cast<std::size_t>(options_.neighbourhood), window.nodes.size());
  if (scale_drifts_) measure_ways(graph, window, count);
  for (std::size_t n = 0; n < count; ++n) {
    const KeyframeId id = window.nodes[n].id;
    if (scale_drifts_ && ways_[n] > options_.max_way_of_one_camera) continue;
    if (id != reference_ && !find_edge(graph.keyframe(reference_), id)) far_.push_back(id);
  }
}

/// From the reference to each member of N2.
void MetricLoopCloser::measure_ways(const GraphSnapshot& graph, const DoubleWindow& window,
                                    std::size_t count) {
  ways_.assign(count, 0);
  for (std::size_t n = 1; n < count; ++n) {
    const auto parent = static_cast<std::size_t>(window.nodes[n].parent);
    const Keyframe& from = graph.keyframe(window.nodes[parent].id);
    const Keyframe& to = graph.keyframe(window.nodes[n].id);
    ways_[n] = ways_[parent] + way_length(from, to, to.T_k_w * from.T_k_w.inverse());
  }
}

/// A: points seen from N2 but not from N1 that should be visible in the reference keyframe, spread evenly
/// over its image.
void MetricLoopCloser::collect_candidates(const GraphSnapshot& graph) {
  near_points_.clear();
  candidates_.clear();
  visible_points(graph, near_, visited_, near_points_);
  const SimilarView view(rig_.camera, graph.keyframe(reference_).T_k_w,
                         {.border_px = options_.border_px, .min_cosine = options_.min_view_cosine});
  const int cells = options_.columns * options_.rows;
  const int per_cell = (options_.max_searches + cells - 1) / cells;
  taken_.assign(static_cast<std::size_t>(cells), 0);
  for (const KeyframeId id : far_) {
    for (const Observation& observation : *graph.keyframe(id).observations) {
      if (!visited_.insert(index(observation.point))) continue;
      const MapPoint& point = graph.point(observation.point);
      const Vector3 x_w = graph.position(observation.point);
      const auto uv = view.find(x_w, graph.T_k_w(point.anchor).inverse().translation());
      if (!uv) continue;
      const int column = static_cast<int>(uv->x() * options_.columns / rig_.camera.width);
      const int row = static_cast<int>(uv->y() * options_.rows / rig_.camera.height);
      int& in_cell = taken_[static_cast<std::size_t>(row * options_.columns + column)];
      if (in_cell == per_cell) continue;
      ++in_cell;
      candidates_.push_back({observation.point, x_w});
    }
  }
}

void MetricLoopCloser::search_candidates(const GraphSnapshot& graph, const FrameImages& images) {
  const SE3& T_ref_w = graph.keyframe(reference_).T_k_w;
  found_.clear();
  motion_.clear();
  for (const Candidate& candidate : candidates_) {
    const MapPoint& point = graph.point(candidate.id);
    const auto match = search_(images, candidate.id, point, T_ref_w * graph.T_k_w(point.anchor).inverse());
    if (!match) continue;
    Observation observation;
    observation.point = candidate.id;
    observation.pixel = match->pixel.cast<float>();
    observation.level = static_cast<std::uint8_t>(match->level);
    found_.push_back(observation);
    motion_.push_back(observe_point(rig_, candidate.x_w, observation.pixel, match->level));
  }
}

/// T_loop: the pose of the reference keyframe that explains the found points best.
std::optional<SE3> MetricLoopCloser::estimate_pose(const SE3& T_ref_w) {
  // Within a wide search radius most matches may be wrong, too many for a robust kernel to find the way from
  // T_ref.
  const auto start = PoseConsensus(rig_, motion_.size(), options_.consensus).find(motion_, min_matches_);
  const MotionOnlyResult result = optimise_motion(rig_, motion_, start.value_or(T_ref_w), {});
  if (result.inliers < min_matches_) return std::nullopt;
  return result.T_c_ref;
}

/// Only points that mutually agree, hence are explained by the common pose, stay.
void MetricLoopCloser::prune(const SE3& T_loop_w) {
  std::size_t kept = 0;
  for (std::size_t n = 0; n < found_.size(); ++n) {
    const Vector3 x = T_loop_w * motion_[n].x_ref;
    if (!in_front_of_camera(x)) continue;
    Vector3 error = (rig_.project(x) - motion_[n].pixel.cast<double>()) / std::ldexp(1.0, found_[n].level);
    if (!weighs_right(motion_[n].information)) error.z() = 0;
    if (error.cwiseAbs().maxCoeff() > options_.max_error_px) continue;
    found_[kept] = found_[n];
    motion_[kept] = motion_[n];
    ++kept;
  }
  found_.resize(kept);
  motion_.resize(kept);
}

bool MetricLoopCloser::well_spread(const std::vector<std::size_t>& matches) const {
  ImageHalves halves(rig_.camera);
  for (const std::size_t n : matches) halves.add(found_[n].pixel.head<2>());
  return halves.least() >= options_.min_half_share * min_matches_;
}

void MetricLoopCloser::connect(GraphWriter& writer, const SE3& T_loop_w, MetricLoopReport& report) {
  found_position_.clear();
  for (std::size_t n = 0; n < found_.size(); ++n) found_position_.set(found_[n].point, static_cast<int>(n));
  std::vector<bool> accepted(found_.size(), false);
  std::vector<std::size_t> shared;
  for (const KeyframeId id : far_) {
    shared.clear();
    for (const Observation& observation : *writer.graph().keyframe(id).observations) {
      const int at = found_position_.find(observation.point);
      if (at >= 0) shared.push_back(static_cast<std::size_t>(at));
    }
    if (static_cast<int>(shared.size()) < min_matches_ || !well_spread(shared)) continue;
    const SE3 T_i_ref = writer.graph().keyframe(id).T_k_w * T_loop_w.inverse();  // eq. 6.8
    link_marginalised(writer, reference_, id, static_cast<int>(shared.size()), T_i_ref);
    for (const std::size_t n : shared) accepted[n] = true;
    ++report.edges;
  }
  std::vector<Observation> added;
  for (std::size_t n = 0; n < found_.size(); ++n) {
    if (accepted[n]) added.push_back(found_[n]);
  }
  report.observations = static_cast<int>(added.size());
  if (!added.empty()) writer.add_observations(reference_, added);
}

}  // namespace twofold
