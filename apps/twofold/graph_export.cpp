#include "apps/twofold/graph_export.hpp"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <iterator>
#include <memory>
#include <set>

#include <fmt/format.h>

#include "slam/map_snapshot.hpp"

namespace twofold {
namespace {

std::string pose_text(const SE3& T) {
  const Eigen::Quaterniond& q = T.so3().quaternion();
  const Vector3& t = T.translation();
  return fmt::format("{:.12g} {:.12g} {:.12g} {:.12g} {:.12g} {:.12g} {:.12g}", t.x(), t.y(), t.z(), q.x(),
                     q.y(), q.z(), q.w());
}

/// Along the worst axis [m]; 0: not known.
float worst_deviation(const MapSnapshot::Point& point) {
  if (std::isnan(point.covariance[0])) return 0;
  Eigen::SelfAdjointEigenSolver<Matrix3> solver;
  solver.computeDirect(Eigen::Map<const Matrix3>(point.covariance.data()), Eigen::EigenvaluesOnly);
  return static_cast<float>(std::sqrt(std::max(0.0, solver.eigenvalues().maxCoeff())));
}

/// Upper triangle of weight * identity.
std::string information_text(int weight) {
  std::string text;
  for (int row = 0; row < 6; ++row) {
    for (int column = row; column < 6; ++column) text += fmt::format(" {}", row == column ? weight : 0);
  }
  return text;
}

}  // namespace

std::size_t live_keyframes(const GraphSnapshot& graph) {
  std::size_t live = 0;
  for (std::uint32_t k = 0; k < graph.keyframe_count(); ++k)
    live += graph.keyframe(KeyframeId{k}).culled() ? 0 : 1;
  return live;
}

Trajectory keyframe_trajectory(const GraphSnapshot& graph, KeyframeId part) {
  return loaded_and_own_keyframes(graph, part, 0).second;
}

std::pair<Trajectory, Trajectory> loaded_and_own_keyframes(const GraphSnapshot& graph, KeyframeId part,
                                                           std::uint32_t loaded) {
  std::pair<Trajectory, Trajectory> lists;
  for (std::uint32_t k = 0; k < graph.keyframe_count(); ++k) {
    const Keyframe& keyframe = graph.keyframe(KeyframeId{k});
    if (keyframe.part == part && !keyframe.culled())
      (k < loaded ? lists.first : lists.second).push_back({keyframe.t_ns, keyframe.T_k_w.inverse()});
  }
  return lists;
}

std::vector<MapSnapshot::Point> points_with_covariance(const Rig& rig, const GraphSnapshot& graph) {
  auto version = std::make_shared<MapVersion>();
  version->graph = graph;
  return MapSnapshot(std::make_shared<const MapSnapshot::Impl>(MapSnapshot::Impl{rig, version})).points();
}

std::vector<PlyPoint> map_points(const std::vector<MapSnapshot::Point>& points, const GraphSnapshot& graph,
                                 KeyframeId part) {
  std::vector<std::uint32_t> lines;  // of keyframe_trajectory: the keyframes' ids
  for (std::uint32_t k = 0; k < graph.keyframe_count(); ++k) {
    const Keyframe& keyframe = graph.keyframe(KeyframeId{k});
    if (keyframe.part == part && !keyframe.culled()) lines.push_back(k);
  }
  std::vector<PlyPoint> some;
  for (const MapSnapshot::Point& point : points) {
    if (point.part != index(part)) continue;
    const std::uint8_t grey =
        graph.point(PointId{point.id})
            .appearance->pixels[PointAppearance::kCentre * (PointAppearance::kSize + 1)];
    PlyPoint& ply = some.emplace_back(
        PlyPoint{Vector3(point.position[0], point.position[1], point.position[2]), {grey, grey, grey}});
    ply.stddev = worst_deviation(point);
    ply.observers = point.observers;
    const auto after = std::upper_bound(lines.begin(), lines.end(), point.anchor);
    if (!lines.empty())
      ply.first_keyframe = static_cast<std::uint32_t>(std::max<std::ptrdiff_t>(after - lines.begin(), 1) - 1);
  }
  return some;
}

std::string edge_list(const GraphSnapshot& graph, KeyframeId part) {
  std::vector<std::uint32_t> place(graph.keyframe_count());
  for (std::uint32_t k = 0, next = 0; k < graph.keyframe_count(); ++k) {
    const Keyframe& keyframe = graph.keyframe(KeyframeId{k});
    if (keyframe.part == part && !keyframe.culled()) place[k] = next++;
  }
  std::string lines;
  for (std::uint32_t k = 0; k < graph.keyframe_count(); ++k) {
    const Keyframe& keyframe = graph.keyframe(KeyframeId{k});
    if (keyframe.part != part || keyframe.culled()) continue;
    for (const Edge& edge : *keyframe.edges) {
      if (edge.other < keyframe.id) continue;
      lines += fmt::format("{} {} {} {}\n", place[k], place[index(edge.other)], edge.weight,
                           edge.marginalised ? "marginalised" : "covisible");
    }
  }
  return lines;
}

std::string g2o_text(const GraphSnapshot& graph) {
  std::string vertices, edges, fixed;
  std::set<KeyframeId> parts;
  for (std::uint32_t k = 0; k < graph.keyframe_count(); ++k) {
    const Keyframe& keyframe = graph.keyframe(KeyframeId{k});
    if (keyframe.culled()) continue;
    // Nothing else ties the parts of a map to each other.
    if (parts.insert(graph.part(keyframe.id)).second) fixed += fmt::format("FIX {}\n", k);
    vertices += fmt::format("VERTEX_SE3:QUAT {} {}\n", k, pose_text(keyframe.T_k_w.inverse()));
    for (const Edge& edge : *keyframe.edges) {
      if (edge.other < keyframe.id) continue;
      const SE3 T_this_other = relative_pose(graph, keyframe.id, edge).inverse();
      edges += fmt::format("EDGE_SE3:QUAT {} {} {}{}\n", k, index(edge.other), pose_text(T_this_other),
                           information_text(std::max(1, edge.weight)));
    }
  }
  return vertices + fixed + edges;
}

}  // namespace twofold
