#pragma once

#include <map>
#include <random>
#include <vector>

#include "camera/rig.hpp"
#include "graph/keyframe_proposal.hpp"
#include "graph/snapshot.hpp"
#include "mapping/metric_loop.hpp"

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

/// Stereo camera of thesis 6.5.1: f = 300, baseline 5 cm, 640 x 480.
[[nodiscard]] Rig thesis_rig(SensorKind kind = SensorKind::kStereo);

/// Camera above the plane z = 0 at the given height, looking down, its x axis along `heading` [rad].
[[nodiscard]] SE3 looking_down(double x, double y, double height, double heading);

/// Points around the plane z = 0 wherever the camera comes, `density` per square metre.
[[nodiscard]] std::vector<Vector3> scattered_points(const std::vector<SE3>& path, double margin,
                                                    double density, unsigned seed);

/// Archimedean spiral from the centre outwards: loopy and exploring at the same time  (fig. 6.9).
[[nodiscard]] std::vector<SE3> spiral_path(int keyframes, double step, double spacing, double height);
/// `laps` rounds of a circle.
[[nodiscard]] std::vector<SE3> circle_path(int keyframes, double laps, double radius, double height);

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
