#pragma once

#include <map>
#include <random>
#include <vector>

#include "camera/rig.hpp"
#include "graph/keyframe_proposal.hpp"
#include "graph/snapshot.hpp"
#include "mapping/metric_loop.hpp"
#include "tests/mapping/simulated_world.hpp"

namespace twofold::simulation {

struct Options {
  Rig rig;
  double noise_px = 1;         ///< standard deviation of each coordinate of a measurement
  int max_observations = 200;  ///< of a keyframe
  double view_radius = 3;      ///< points farther from the camera in x and y are not looked at [m]
  /// True: a world point is one map point for ever (known association). False: as a tracker would, a map
  /// point is only recognised while a keyframe of the reference's N1 sees it, else a new one is started.
  bool global_association = true;
  double outliers = 0;  ///< share of wrong measurements
  unsigned seed = 1;
};

/// A camera with true poses among true points that proposes one keyframe after the other to a mapper, as a
/// tracker would: poses by motion-only BA against the map as it stands, points started by stereo (or, for one
/// camera, with a rough depth) and confirmed in the next keyframe.
class Simulation {
 public:
  Simulation(const Options& options, std::vector<Vector3> points, std::vector<SE3> T_k_w);

  [[nodiscard]] const Rig& rig() const { return options_.rig; }
  [[nodiscard]] bool done() const { return next_ == T_k_w_.size(); }
  /// Proposal of the next keyframe; valid until the next call.
  KeyframeProposal& propose(const GraphSnapshot& graph);
  /// Finds points in the keyframe proposed last where truth has them, within a radius of the prediction.
  [[nodiscard]] PointSearch search(double radius_px) const;

  [[nodiscard]] const SE3& true_pose(KeyframeId id) const { return T_k_w_[index(id)]; }
  [[nodiscard]] int world_point(PointId id) const { return world_of_[index(id)]; }

 private:
  using Measurements = std::map<int, Vector3>;  ///< by world point

  [[nodiscard]] Measurements measure(std::size_t k);
  [[nodiscard]] PointId known_point(const GraphSnapshot& graph, int world,
                                    const std::vector<KeyframeId>& near) const;
  void start_point(int world, const Vector3& z_previous);
  [[nodiscard]] SE3 track(const GraphSnapshot& graph, const SE3& T_start) const;

  Options options_;
  std::vector<Vector3> points_;
  std::vector<SE3> T_k_w_;
  std::map<std::pair<int, int>, std::vector<int>> cells_;
  std::mt19937 rng_;
  std::size_t next_ = 0;
  Measurements previous_, current_;
  std::vector<int> world_of_;                ///< by map point
  std::vector<std::vector<PointId>> known_;  ///< map points of a world point, newest last
  KeyframeProposal proposal_;
};

/// A spiral of 45 keyframes measured without noise: whatever is wrong in its map, the mapper did.
inline Simulation noise_free_spiral() {
  Options options;
  options.rig = thesis_rig();
  options.noise_px = 0;
  options.max_observations = 120;
  const std::vector<SE3> path = spiral_path(45, 0.2, 0.8, 1.2);
  return {options, scattered_points(path, 2, 25, 1), path};
}

/// RMSE of eq. 6.10 over the edges that `use` accepts [m]; the number of edges if asked for.
struct RelativeError {
  double rmse = 0;
  int edges = 0;
};
template <class Use>
[[nodiscard]] RelativeError relative_error(const GraphSnapshot& graph, const Simulation& simulation,
                                           Use&& use) {
  RelativeError error;
  for (std::uint32_t k = 0; k < graph.keyframe_count(); ++k) {
    const Keyframe& i = graph.keyframe(KeyframeId{k});
    for (const Edge& edge : *i.edges) {
      if (edge.other < i.id || !use(i.id, edge.other)) continue;
      const SE3 estimated = i.T_k_w * graph.keyframe(edge.other).T_k_w.inverse();
      const SE3 truth = simulation.true_pose(i.id) * simulation.true_pose(edge.other).inverse();
      error.rmse += (estimated.translation() - truth.translation()).squaredNorm();
      ++error.edges;
    }
  }
  if (error.edges > 0) error.rmse = std::sqrt(error.rmse / error.edges);
  return error;
}

}  // namespace twofold::simulation
