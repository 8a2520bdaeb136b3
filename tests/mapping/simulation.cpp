#include "tests/mapping/simulation.hpp"

#include <algorithm>
#include <cmath>

#include "estimation/motion_only.hpp"
#include "geometry/inverse_depth.hpp"
#include "graph/neighbourhood.hpp"

namespace twofold::simulation {
namespace {

constexpr double kMinDisparityPx = 1.5;

}  // namespace

Simulation::Simulation(const Options& options, std::vector<Vector3> points, std::vector<SE3> T_k_w)
    : options_(options),
      points_(std::move(points)),
      T_k_w_(std::move(T_k_w)),
      rng_(options.seed),
      known_(points_.size()) {
  for (std::size_t p = 0; p < points_.size(); ++p) {
    cells_[cell_of(points_[p].x(), points_[p].y())].push_back(static_cast<int>(p));
  }
}

/// The first of the visible points by number, so that neighbouring keyframes choose the same ones.
Simulation::Measurements Simulation::measure(std::size_t k) {
  const SE3& T_k_w = T_k_w_[k];
  const Vector3 centre = T_k_w.inverse().translation();
  const auto [x0, y0] = cell_of(centre.x() - options_.view_radius, centre.y() - options_.view_radius);
  const auto [x1, y1] = cell_of(centre.x() + options_.view_radius, centre.y() + options_.view_radius);
  std::vector<int> visible;
  for (int x = x0; x <= x1; ++x) {
    for (int y = y0; y <= y1; ++y) {
      const auto cell = cells_.find({x, y});
      if (cell == cells_.end()) continue;
      for (const int p : cell->second) {
        const Vector3 x_c = T_k_w * points_[static_cast<std::size_t>(p)];
        if (x_c.z() > 0.1 && options_.rig.camera.contains(options_.rig.camera.project(x_c), 4)) {
          visible.push_back(p);
        }
      }
    }
  }
  std::sort(visible.begin(), visible.end());
  if (visible.size() > static_cast<std::size_t>(options_.max_observations)) {
    visible.resize(static_cast<std::size_t>(options_.max_observations));
  }
  std::normal_distribution<double> noise(0, options_.noise_px);
  std::uniform_real_distribution<double> uniform;
  Measurements measurements;
  for (const int p : visible) {
    Vector3 z = options_.rig.project(T_k_w * points_[static_cast<std::size_t>(p)]);
    for (int c = 0; c < 3; ++c) z[c] += noise(rng_);
    if (options_.outliers > 0 && uniform(rng_) < options_.outliers) {
      const double du = 60 * uniform(rng_) - 30, dv = 60 * uniform(rng_) - 30;
      z += Vector3(du, dv, du);
    }
    if (options_.rig.kind == SensorKind::kMono) z.z() = Rig::kNoRight;
    measurements[p] = z;
  }
  return measurements;
}

PointId Simulation::known_point(const GraphSnapshot& graph, int world,
                                const std::vector<KeyframeId>& near) const {
  const auto& ids = known_[static_cast<std::size_t>(world)];
  for (std::size_t n = ids.size(); n-- > 0;) {
    if (!graph.contains(ids[n]) || !graph.point(ids[n]).alive()) continue;
    if (options_.global_association) return ids[n];
    for (const KeyframeId observer : *graph.point(ids[n]).observers) {
      if (std::find(near.begin(), near.end(), observer) != near.end()) return ids[n];
    }
  }
  return kNoPoint;
}

/// Seen in the previous keyframe and in this one, but not in the map.
void Simulation::start_point(int world, const Vector3& z_previous) {
  const Rig& rig = options_.rig;
  NewPoint point;
  point.id = PointId{static_cast<std::uint32_t>(world_of_.size())};
  point.anchor = KeyframeId{static_cast<std::uint32_t>(next_ - 1)};
  double depth = (T_k_w_[next_ - 1] * points_[static_cast<std::size_t>(world)]).z();
  if (rig.kind == SensorKind::kMono) {
    depth *= std::exp(std::normal_distribution<double>(0, 0.1)(rng_));
  } else {
    const double disparity = z_previous.x() - z_previous.z();
    if (disparity < kMinDisparityPx) return;
    depth = rig.depth_from_disparity(disparity);
  }
  point.psi = to_inverse_depth(rig.camera.unproject(z_previous.head<2>()) * depth);
  point.anchor_observation.point = point.id;
  point.anchor_observation.z = z_previous.cast<float>();
  point.appearance.uv = z_previous.head<2>().cast<float>();
  proposal_.new_points.push_back(point);
  known_[static_cast<std::size_t>(world)].push_back(point.id);
  world_of_.push_back(world);
}

/// Pose of the new keyframe relative to its reference against the map and the points about to join it.
SE3 Simulation::track(const GraphSnapshot& graph, const SE3& T_start) const {
  const SE3 T_ref_w = graph.T_k_w(proposal_.reference);
  std::vector<MotionObservation> seen;
  for (const Observation& observation : proposal_.observations) {
    MotionObservation motion;
    motion.z = observation.z;
    if (options_.rig.kind == SensorKind::kMono) {
      motion.z.z() = 0;
      motion.information.z() = 0;
    }
    if (graph.contains(observation.point) && graph.point(observation.point).alive()) {
      motion.x_ref = T_ref_w * graph.position(observation.point);
    } else {
      const auto point = std::find_if(proposal_.new_points.begin(), proposal_.new_points.end(),
                                      [&](const NewPoint& p) { return p.id == observation.point; });
      const SE3 T_ref_a = T_ref_w * graph.T_k_w(point->anchor).inverse();
      motion.x_ref = T_ref_a * from_inverse_depth(point->psi);
    }
    seen.push_back(motion);
  }
  return optimise_motion(options_.rig, seen, T_start, {}).T_c_ref;
}

KeyframeProposal& Simulation::propose(const GraphSnapshot& graph) {
  previous_ = std::move(current_);
  current_ = measure(next_);
  proposal_.clear();
  proposal_.id = KeyframeId{static_cast<std::uint32_t>(next_)};
  proposal_.frame_index = static_cast<std::int64_t>(next_);
  proposal_.t_ns = static_cast<std::int64_t>(next_) * 500'000'000;
  std::vector<double> depths;
  for (const auto& [world, z] : current_) {
    depths.push_back((T_k_w_[next_] * points_[static_cast<std::size_t>(world)]).z());
  }
  std::sort(depths.begin(), depths.end());
  proposal_.median_depth = depths.empty() ? 1 : depths[depths.size() / 2];
  if (next_ == 0) {
    proposal_.T_k_ref = T_k_w_[0];
    ++next_;
    return proposal_;
  }
  proposal_.snapshot_version = graph.version();
  proposal_.reference = graph.reference();
  std::vector<KeyframeId> near;
  direct_neighbours(graph, proposal_.reference, 1000, near);
  for (const auto& [world, z] : current_) {
    PointId id = known_point(graph, world, near);
    if (id == kNoPoint && previous_.contains(world)) {
      const std::size_t before = proposal_.new_points.size();
      start_point(world, previous_.at(world));
      if (proposal_.new_points.size() > before) id = proposal_.new_points.back().id;
    }
    if (id == kNoPoint) continue;
    Observation observation;
    observation.point = id;
    observation.z = z.cast<float>();
    proposal_.observations.push_back(observation);
  }
  std::sort(proposal_.observations.begin(), proposal_.observations.end(),
            [](const Observation& a, const Observation& b) { return a.point < b.point; });
  const SE3 T_true = T_k_w_[next_] * T_k_w_[index(proposal_.reference)].inverse();
  proposal_.T_k_ref = track(graph, T_true);
  ++next_;
  return proposal_;
}

PointSearch Simulation::search(double radius_px) const {
  return [this, radius_px](const FrameImages&, PointId id, const MapPoint& point,
                           const SE3& T_k_a) -> std::optional<PointMatch> {
    const auto seen = current_.find(world_of_[index(id)]);
    if (seen == current_.end()) return std::nullopt;
    const Vector3 x = T_k_a * from_inverse_depth(point.psi);
    if (!(x.z() > 0)) return std::nullopt;
    if ((options_.rig.camera.project(x) - seen->second.head<2>()).norm() > radius_px) return std::nullopt;
    PointMatch match;
    match.z = seen->second;
    return match;
  };
}

}  // namespace twofold::simulation
