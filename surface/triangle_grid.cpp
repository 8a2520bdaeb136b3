#include "surface/triangle_grid.hpp"

#include <algorithm>
#include <array>
#include <cmath>

#include <fmt/format.h>
#include <Eigen/Geometry>

namespace twofold {
namespace {

using Eigen::Vector3f;

float distance_to_segment(const Vector3f& x, const Vector3f& a, const Vector3f& b) {
  const Vector3f ab = b - a;
  const float length2 = ab.squaredNorm();
  const float t = length2 > 0 ? std::clamp((x - a).dot(ab) / length2, 0.0f, 1.0f) : 0.0f;
  return (x - a - t * ab).norm();
}

}  // namespace

float distance_to_triangle(const Vector3f& x, const Vector3f& a, const Vector3f& b, const Vector3f& c) {
  const Vector3f normal = (b - a).cross(c - a);
  const float doubled_area = normal.norm();
  const bool over_it = doubled_area > 0 && normal.dot((b - a).cross(x - a)) >= 0 &&
                       normal.dot((c - b).cross(x - b)) >= 0 && normal.dot((a - c).cross(x - c)) >= 0;
  if (over_it) return std::abs(normal.dot(x - a)) / doubled_area;
  return std::min({distance_to_segment(x, a, b), distance_to_segment(x, b, c), distance_to_segment(x, c, a)});
}

std::string too_large_reason(const TriangleMesh& mesh, double spacing) {
  constexpr double kMostPoints = 2e8;
  double points = 0, most = 0;
  std::size_t largest = 0;
  for (std::size_t n = 0; n < mesh.triangles.size(); ++n) {
    const auto& t = mesh.triangles[n];
    const Eigen::Vector3d a = mesh.positions[t[0]].cast<double>();
    const Eigen::Vector3d ab = mesh.positions[t[1]].cast<double>() - a;
    const Eigen::Vector3d ac = mesh.positions[t[2]].cast<double>() - a;
    // A sliver is a row of points.
    const double length = std::max({ab.norm(), ac.norm(), (ac - ab).norm()}) / spacing;
    const double here = std::max(length, ab.cross(ac).norm() / (spacing * spacing));
    points += here;
    if (!(here > most)) continue;
    most = here;
    largest = n;
  }
  if (points <= kMostPoints) return {};
  const Eigen::Vector3f x = mesh.positions[mesh.triangles[largest][0]];
  return fmt::format(
      "is too large to be compared every {:g} m; its largest triangle is number {}, at ({:g}, {:g}, {:g})",
      spacing, largest, x.x(), x.y(), x.z());
}

TriangleMesh subdivided(const TriangleMesh& mesh, float longest) {
  TriangleMesh fine;
  fine.positions = mesh.positions;
  std::vector<std::array<std::uint32_t, 3>> open(mesh.triangles.rbegin(), mesh.triangles.rend());
  while (!open.empty()) {
    const auto t = open.back();
    open.pop_back();
    std::array<float, 3> side;  // opposite of each corner
    for (std::size_t i = 0; i < 3; ++i)
      side[i] = (fine.positions[t[(i + 1) % 3]] - fine.positions[t[(i + 2) % 3]]).norm();
    const auto i = static_cast<std::size_t>(std::max_element(side.begin(), side.end()) - side.begin());
    if (side[i] <= longest) {
      fine.triangles.push_back(t);
      continue;
    }
    const auto middle = static_cast<std::uint32_t>(fine.positions.size());
    fine.positions.emplace_back(0.5f * (fine.positions[t[(i + 1) % 3]] + fine.positions[t[(i + 2) % 3]]));
    open.push_back({t[i], middle, t[(i + 2) % 3]});
    open.push_back({t[i], t[(i + 1) % 3], middle});
  }
  return fine;
}

std::vector<MeshPoint> sample_surface(const TriangleMesh& mesh, float spacing) {
  std::vector<MeshPoint> samples;
  double owed = 0.5;  // points that the area passed so far is still to get
  double u = 0, v = 0;
  for (std::uint32_t n = 0; n < mesh.triangles.size(); ++n) {
    const auto& t = mesh.triangles[n];
    const Vector3f a = mesh.positions[t[0]];
    const Vector3f ab = mesh.positions[t[1]] - a;
    const Vector3f ac = mesh.positions[t[2]] - a;
    owed += 0.5 * ab.cross(ac).norm() / (static_cast<double>(spacing) * spacing);
    for (; owed >= 1; owed -= 1) {
      // An additive recurrence fills the square evenly (Roberts' R2); its upper half is folded down.
      u = std::fmod(u + 0.7548776662466927, 1.0);
      v = std::fmod(v + 0.5698402909980532, 1.0);
      const bool fold = u + v > 1;
      samples.push_back(
          {a + static_cast<float>(fold ? 1 - u : u) * ab + static_cast<float>(fold ? 1 - v : v) * ac, n});
    }
  }
  return samples;
}

TriangleGrid::TriangleGrid(const TriangleMesh& mesh, float reach)
    : reach_(reach), cell_(reach / kCellsToReach), mesh_(subdivided(mesh, 8 * cell_)) {
  for (std::uint32_t n = 0; n < mesh_.triangles.size(); ++n) {
    const auto& t = mesh_.triangles[n];
    const Vector3f low =
        mesh_.positions[t[0]].cwiseMin(mesh_.positions[t[1]]).cwiseMin(mesh_.positions[t[2]]);
    const Vector3f high =
        mesh_.positions[t[0]].cwiseMax(mesh_.positions[t[1]]).cwiseMax(mesh_.positions[t[2]]);
    const Eigen::Vector3i first = cell_of(low);
    const Eigen::Vector3i last = cell_of(high);
    for (int z = first.z(); z <= last.z(); ++z)
      for (int y = first.y(); y <= last.y(); ++y)
        for (int x = first.x(); x <= last.x(); ++x) {
          const Vector3f centre = cell_ * Vector3f(static_cast<float>(x) + 0.5f, static_cast<float>(y) + 0.5f,
                                                   static_cast<float>(z) + 0.5f);
          const float d = distance_to_triangle(centre, mesh_.positions[t[0]], mesh_.positions[t[1]],
                                               mesh_.positions[t[2]]);
          if (d <= 0.87f * cell_) cells_[key_of({x, y, z})].push_back(n);  // half a cell's diagonal
        }
  }
}

Eigen::Vector3i TriangleGrid::cell_of(const Vector3f& x) const {
  return (x / cell_).array().floor().cast<int>();
}

TriangleGrid::CellKey TriangleGrid::key_of(const Eigen::Vector3i& cell) {
  const auto part = [](int c) { return static_cast<CellKey>(c + (1 << 20)) & 0x1fffff; };
  return part(cell.x()) << 42 | part(cell.y()) << 21 | part(cell.z());
}

TriangleGrid::Nearest TriangleGrid::nearest(const Vector3f& x) const {
  const Eigen::Vector3i home = cell_of(x);
  Nearest nearest{reach_, kNone};
  const auto look_into = [&](const Eigen::Vector3i& cell) {
    const auto found = cells_.find(key_of(cell));
    if (found == cells_.end()) return;
    for (const std::uint32_t n : found->second) {
      const auto& t = mesh_.triangles[n];
      const float d =
          distance_to_triangle(x, mesh_.positions[t[0]], mesh_.positions[t[1]], mesh_.positions[t[2]]);
      if (d < nearest.distance) nearest = {d, n};
    }
  };
  // What lies in shell k of the cells around is at least k - 1 cells away.
  for (int k = 0; k <= kCellsToReach && nearest.distance > static_cast<float>(k - 1) * cell_; ++k)
    for (int dz = -k; dz <= k; ++dz)
      for (int dy = -k; dy <= k; ++dy) {
        const bool whole_row = std::abs(dz) == k || std::abs(dy) == k;
        for (int dx = -k; dx <= k; dx += whole_row || k == 0 ? 1 : 2 * k)
          look_into(home + Eigen::Vector3i(dx, dy, dz));
      }
  return nearest;
}

float TriangleGrid::distance(const Vector3f& x) const {
  return nearest(x).distance;
}

std::optional<TriangleGrid::Plane> TriangleGrid::nearest_plane(const Vector3f& x) const {
  const Nearest found = nearest(x);
  if (found.triangle == kNone) return std::nullopt;
  const auto& t = mesh_.triangles[found.triangle];
  const Vector3f a = mesh_.positions[t[0]];
  const Vector3f normal = (mesh_.positions[t[1]] - a).cross(mesh_.positions[t[2]] - a);
  if (!(normal.norm() > 0)) return std::nullopt;
  const Vector3f unit = normal.normalized();
  return Plane{unit, unit.dot(a), found.distance};
}

}  // namespace twofold
