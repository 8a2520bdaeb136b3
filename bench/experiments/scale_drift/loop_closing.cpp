#include "experiments/scale_drift/loop_closing.hpp"

#include <algorithm>
#include <cmath>
#include <map>
#include <type_traits>

#include "geometry/absolute_orientation.hpp"
#include "geometry/ransac.hpp"

namespace twofold::bench {
namespace {

constexpr int kMinViews = 3;  ///< of a point that serves to close a loop: its depth is known well by then
constexpr int kReach = 4;     ///< frames on either side whose points belong to a frame's surroundings

/// A point in a camera's frame, with the information its sightings give (one pixel, poses fixed).
struct EstimatedPoint {
  Vector3 x;
  Matrix3 information;
};

/// sum of J^T J over the sightings, J = d(pixel) / d(point in the camera's frame).
Matrix3 point_information(const Rig& rig, const ExplorationResult& map, const Track& track,
                          const SE3& T_c_w) {
  Matrix3 sum = Matrix3::Zero();
  for (int k = track.first_frame; k <= track.last_frame(); ++k) {
    const SE3 T_k_c = map.T_c_w[static_cast<std::size_t>(k)] * T_c_w.inverse();
    const Vector3 x = T_k_c * (T_c_w * *track.x_w);
    Eigen::Matrix<double, 2, 3> J;
    J << rig.camera.fx / x.z(), 0, -rig.camera.fx * x.x() / (x.z() * x.z()),  //
        0, rig.camera.fy / x.z(), -rig.camera.fy * x.y() / (x.z() * x.z());
    J = J * T_k_c.rotation();
    sum += J.transpose() * J;
  }
  return sum;
}

/// Points of the map around a frame by point of the scene: those of one frame alone, seen under a narrow
/// angle, would leave the rotation to the noise of their depths.
std::map<int, EstimatedPoint> points_around(const Rig& rig, const ExplorationResult& map, int frame) {
  std::map<int, EstimatedPoint> points;
  const SE3& T_c_w = map.T_c_w[static_cast<std::size_t>(frame)];
  const int first = std::max(0, frame - kReach);
  const int last = std::min(static_cast<int>(map.seen.size()) - 1, frame + kReach);
  for (int k = first; k <= last; ++k) {
    for (const int t : map.seen[static_cast<std::size_t>(k)]) {
      const Track& track = map.tracks[static_cast<std::size_t>(t)];
      if (!track.x_w || track.uv.size() < kMinViews) continue;
      points[track.point] = {T_c_w * *track.x_w, point_information(rig, map, track, T_c_w)};
    }
  }
  return points;
}

/// Three-point similarity (thesis 5.3.1); residuals relative to the depth, since the scale is arbitrary.
struct SimilarityEstimator {
  using Model = Sim3;
  static constexpr int kSampleSize = 3;
  const std::vector<Vector3>& x_j;
  const std::vector<Vector3>& x_i;

  [[nodiscard]] int size() const { return static_cast<int>(x_j.size()); }
  void fit(std::span<const int, kSampleSize> sample, std::vector<Sim3>& models) const {
    std::vector<Vector3> a, b;
    for (const int k : sample) {
      a.push_back(x_j[static_cast<std::size_t>(k)]);
      b.push_back(x_i[static_cast<std::size_t>(k)]);
    }
    if (const auto S = align_similarity(a, b)) models.push_back(*S);
  }
  [[nodiscard]] double squared_residual(const Sim3& S, int k) const {
    const Vector3& x = x_j[static_cast<std::size_t>(k)];
    return (x - S * x_i[static_cast<std::size_t>(k)]).squaredNorm() / x.squaredNorm();
  }
};

/// Gauss-Newton on sum (x_j - S x_i)^T C^-1 (x_j - S x_i), C the covariance of the difference: bundle
/// adjustment of the two places' points over S, their cameras fixed, to first order  (thesis 5.3.1).
Sim3 refine(const std::vector<std::pair<EstimatedPoint, EstimatedPoint>>& pairs, Sim3 S_j_i) {
  for (int iteration = 0; iteration < 5; ++iteration) {
    const Matrix3 sR = S_j_i.scale() * S_j_i.rotation();
    Matrix7 H = Matrix7::Zero();
    Vector7 g = Vector7::Zero();
    for (const auto& [in_i, in_j] : pairs) {
      const Matrix3 C = in_j.information.inverse() + sR * in_i.information.inverse() * sR.transpose();
      const Vector3 y = S_j_i * in_i.x;
      Eigen::Matrix<double, 3, 7> J;  // of exp(delta) y
      J << Matrix3::Identity(), -hat(y), y;
      const Eigen::Matrix<double, 7, 3> JW = J.transpose() * C.inverse();
      H += JW * J;
      g += JW * (in_j.x - y);
    }
    S_j_i = Sim3::exp(H.ldlt().solve(g)) * S_j_i;
  }
  return S_j_i;
}

template <class Group>
Group constraint(const Sim3& S_j_i) {
  if constexpr (std::is_same_v<Group, Sim3>) {
    return S_j_i;
  } else {
    return {S_j_i.so3(), S_j_i.translation() / std::sqrt(S_j_i.scale())};
  }
}

}  // namespace

std::optional<LoopConstraint> close_loop(const Rig& rig, const ExplorationResult& map, int i_begin, int i_end,
                                         int j) {
  const std::map<int, EstimatedPoint> in_j = points_around(rig, map, j);
  std::vector<std::pair<EstimatedPoint, EstimatedPoint>> pairs;
  LoopConstraint loop{.i = -1, .j = j, .S_j_i = {}};
  for (int i = i_begin; i < i_end; ++i) {
    std::vector<std::pair<EstimatedPoint, EstimatedPoint>> shared;
    for (const auto& [point, x] : points_around(rig, map, i)) {
      const auto other = in_j.find(point);
      if (other != in_j.end()) shared.emplace_back(x, other->second);
    }
    if (shared.size() <= pairs.size()) continue;
    loop.i = i;
    pairs = std::move(shared);
  }
  std::vector<Vector3> x_i, x_j;
  for (const auto& [in_i, in_j_too] : pairs) {
    x_i.push_back(in_i.x);
    x_j.push_back(in_j_too.x);
  }
  const SimilarityEstimator estimator{x_j, x_i};
  const auto found = ransac(estimator, {.threshold = 0.1});
  if (!found || found->inliers.size() < 10) return std::nullopt;
  std::vector<std::pair<EstimatedPoint, EstimatedPoint>> inliers;
  for (const int k : found->inliers) inliers.push_back(pairs[static_cast<std::size_t>(k)]);
  loop.S_j_i = refine(inliers, found->model);
  loop.inliers = static_cast<int>(inliers.size());
  return loop;
}

template <class Group>
PoseGraph<Group> pose_graph(const ExplorationResult& map, const std::vector<LoopConstraint>& loops) {
  PoseGraph<Group> graph;
  for (const SE3& T : map.T_c_w) graph.poses.emplace_back(T);
  for (int j = 1; j < static_cast<int>(map.T_c_w.size()); ++j) {
    const SE3& T_i = map.T_c_w[static_cast<std::size_t>(j) - 1];
    const SE3& T_j = map.T_c_w[static_cast<std::size_t>(j)];
    graph.constraints.push_back({j - 1, j, Group(T_j * T_i.inverse())});
  }
  for (const LoopConstraint& loop : loops) {
    graph.constraints.push_back({loop.i, loop.j, constraint<Group>(loop.S_j_i)});
  }
  return graph;
}

template <class Group>
std::vector<Vector3> corrected_centres(const ExplorationResult& map,
                                       const std::vector<LoopConstraint>& loops) {
  PoseGraph<Group> graph = pose_graph<Group>(map, loops);
  PoseGraphOptions options;
  options.jacobian = CbhOrder::kThird;
  options.relative_decrease = 1e-9;
  PoseGraphSolver<Group>().solve(graph, options);
  std::vector<Vector3> centres;
  for (const Group& pose : graph.poses) centres.push_back(pose.inverse().translation());
  return centres;
}

std::vector<Vector3> camera_centres(const std::vector<SE3>& T_c_w) {
  std::vector<Vector3> centres;
  for (const SE3& T : T_c_w) centres.push_back(T.inverse().translation());
  return centres;
}

double scaled_rmse(const std::vector<Vector3>& truth, const std::vector<Vector3>& corrected,
                   const Vector3& origin) {
  double cross = 0, square = 0;
  for (std::size_t k = 0; k < truth.size(); ++k) {
    const Vector3 t = truth[k] - origin, c = corrected[k] - origin;
    cross += t.dot(c);
    square += c.squaredNorm();
  }
  const double s = square > 0 ? cross / square : 0;
  double M = 0;
  for (std::size_t k = 0; k < truth.size(); ++k) {
    M += ((truth[k] - origin) - s * (corrected[k] - origin)).squaredNorm();
  }
  return std::sqrt(M / static_cast<double>(truth.size()));
}

template PoseGraph<SE3> pose_graph<SE3>(const ExplorationResult&, const std::vector<LoopConstraint>&);
template PoseGraph<Sim3> pose_graph<Sim3>(const ExplorationResult&, const std::vector<LoopConstraint>&);
template std::vector<Vector3> corrected_centres<SE3>(const ExplorationResult&,
                                                     const std::vector<LoopConstraint>&);
template std::vector<Vector3> corrected_centres<Sim3>(const ExplorationResult&,
                                                      const std::vector<LoopConstraint>&);

}  // namespace twofold::bench
