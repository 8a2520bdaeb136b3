#include "experiments/double_window/feeder.hpp"

#include <algorithm>

#include "estimation/motion_only.hpp"
#include "geometry/inverse_depth.hpp"
#include "geometry/triangulation.hpp"
#include "graph/neighbourhood.hpp"

namespace twofold::bench {
namespace {

constexpr double kMinDisparityPx = 1.5;
constexpr double kMinParallax = 0.01;  // [rad]

}  // namespace

Feeder::Feeder(const Scene& scene, Association association)
    : scene_(scene), association_(association), known_(scene.points.size()) {}

Observation Feeder::observe(PointId id, const StereoPixel& z) const {
  Observation observation;
  observation.point = id;
  observation.pixel = z.cast<float>();
  if (scene_.rig.kind == SensorKind::kMono) observation.pixel.z() = static_cast<float>(Rig::kNoRight);
  return observation;
}

KeyframeProposal& Feeder::propose(const GraphSnapshot& graph) {
  proposal_.clear();
  proposal_.id = KeyframeId{static_cast<std::uint32_t>(next_)};
  proposal_.frame_index = next_;
  proposal_.t_ns = next_ * std::int64_t{500'000'000};
  proposal_.median_depth = scene_.median_depth(next_);
  if (next_ == 0) {
    proposal_.T_k_ref = scene_.T_k_w[0];
    ++next_;
    return proposal_;
  }
  proposal_.snapshot_version = graph.version();
  proposal_.reference = KeyframeId{static_cast<std::uint32_t>(next_ - 1)};
  associate(graph);
  track(graph);
  start_points();
  std::sort(proposal_.observations.begin(), proposal_.observations.end(),
            [](const Observation& a, const Observation& b) { return a.point < b.point; });
  T_step_ = proposal_.T_k_ref;
  ++next_;
  return proposal_;
}

void Feeder::associate(const GraphSnapshot& graph) {
  std::vector<KeyframeId> near;
  direct_neighbours(graph, proposal_.reference, graph.keyframe_count(), near);
  std::sort(near.begin(), near.end());
  const auto recognised = [&](PointId id) {
    if (!graph.contains(id) || graph.point(id).culled()) return false;
    if (association_ == Association::kGlobal) return true;
    const ObserverList& observers = *graph.point(id).observers;
    return std::any_of(observers.begin(), observers.end(), [&](KeyframeId observer) {
      return std::binary_search(near.begin(), near.end(), observer);
    });
  };
  unknown_.clear();
  for (const Scene::Sighting& sighting : scene_.seen[static_cast<std::size_t>(next_)]) {
    const PointId id = map_point(sighting.point, recognised);
    if (id == kNoPoint) {
      unknown_.push_back(sighting);
    } else {
      proposal_.observations.push_back(observe(id, sighting.pixel));
    }
  }
}

/// Pose of the new keyframe relative to its reference, from the points the map has.
void Feeder::track(const GraphSnapshot& graph) {
  const SE3 T_ref_w = graph.T_k_w(proposal_.reference);
  Rig rig = scene_.rig;
  rig.noise.sigma_px = 1;  // whatever the scene's: all points weigh alike, and some scenes have none
  std::vector<MotionObservation> seen;
  const auto add = [&](const Vector3& x_ref, const Observation& observation) {
    seen.push_back(observe_point(rig, x_ref, observation.pixel, observation.level));
  };
  for (const Observation& observation : proposal_.observations) {
    add(T_ref_w * graph.position(observation.point), observation);
  }
  proposal_.T_k_ref = T_step_;
  if (next_ == 1) {  // there is no map yet
    if (rig.kind == SensorKind::kMono) {
      proposal_.T_k_ref = scene_.T_k_w[1] * scene_.T_k_w[0].inverse();
      return;
    }
    for (const Scene::Sighting& a : scene_.seen[0]) {
      for (const Scene::Sighting& b : unknown_) {
        if (a.point == b.point && a.pixel.x() - a.pixel.z() > kMinDisparityPx) {
          add(rig.unproject(a.pixel), observe(kNoPoint, b.pixel));
        }
      }
    }
  }
  proposal_.T_k_ref = optimise_motion(rig, seen, proposal_.T_k_ref, {}).T_c_ref;
}

bool Feeder::start_value(const StereoPixel& z_previous, const StereoPixel& z, const SE3& T_previous_k,
                         Vector3& psi) const {
  const Vector3 ray = scene_.rig.camera.unproject(z_previous.head<2>());
  if (scene_.rig.kind != SensorKind::kMono) {
    const double disparity = z_previous.x() - z_previous.z();
    if (disparity < kMinDisparityPx) return false;
    psi = to_inverse_depth(ray * scene_.rig.depth_from_disparity(disparity));
    return true;
  }
  const auto x = triangulate_midpoint(ray.normalized(), scene_.rig.camera.unproject(z.head<2>()).normalized(),
                                      T_previous_k, kMinParallax);
  if (!x) return false;
  psi = to_inverse_depth(*x);
  return true;
}

/// Points seen in the previous keyframe and in this one, but not in the map.
void Feeder::start_points() {
  const auto& previous = scene_.seen[static_cast<std::size_t>(next_ - 1)];
  const SE3 T_previous_k = proposal_.T_k_ref.inverse();
  for (const Scene::Sighting& sighting : unknown_) {
    const auto at = std::lower_bound(previous.begin(), previous.end(), sighting.point,
                                     [](const Scene::Sighting& s, int point) { return s.point < point; });
    if (at == previous.end() || at->point != sighting.point) continue;
    ProposedPoint point;
    if (!start_value(at->pixel, sighting.pixel, T_previous_k, point.psi)) continue;
    point.id = free_point_;
    point.anchor = proposal_.reference;
    point.anchor_observation = observe(point.id, at->pixel);
    proposal_.points.push_back(point);
    proposal_.observations.push_back(observe(point.id, sighting.pixel));
    known_[static_cast<std::size_t>(sighting.point)].push_back(point.id);
    free_point_ = PointId{index(free_point_) + 1};
  }
}

}  // namespace twofold::bench
