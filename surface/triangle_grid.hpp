#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <unordered_map>
#include <vector>

#include "geometry/triangle_mesh.hpp"

namespace twofold {

/// Empty, or which triangle makes a surface too large to be looked at every `spacing` [m]: a stray vertex far
/// away would take all memory.
[[nodiscard]] std::string too_large_reason(const TriangleMesh& mesh, double spacing);

/// Splits triangles at the middle of their longest side until no side is longer than `longest` [m] > 0; keeps
/// positions only.
[[nodiscard]] TriangleMesh subdivided(const TriangleMesh& mesh, float longest);

struct MeshPoint {
  Eigen::Vector3f position{0, 0, 0};
  std::uint32_t triangle = 0;  ///< that it lies on
};
/// Points spread evenly over a mesh, one for each `spacing`^2 of area; the same for the same mesh.
[[nodiscard]] std::vector<MeshPoint> sample_surface(const TriangleMesh& mesh, float spacing);

/// Finds the distance of points to a mesh: its triangles sorted into the cells of a grid.
class TriangleGrid {
 public:
  /// reach: distances beyond it are not looked for [m] > 0
  TriangleGrid(const TriangleMesh& mesh, float reach);

  /// Distance to the nearest triangle [m], at most the reach.
  [[nodiscard]] float distance(const Eigen::Vector3f& x) const;
  /// The plane of the nearest triangle within reach.
  struct Plane {
    Eigen::Vector3f normal{0, 0, 1};  ///< unit
    float offset = 0;                 ///< normal . x of its points
    float distance = 0;               ///< of the triangle [m]
  };
  [[nodiscard]] std::optional<Plane> nearest_plane(const Eigen::Vector3f& x) const;

 private:
  static constexpr int kCellsToReach = 4;
  using CellKey = std::uint64_t;
  [[nodiscard]] Eigen::Vector3i cell_of(const Eigen::Vector3f& x) const;
  [[nodiscard]] static CellKey key_of(const Eigen::Vector3i& cell);
  struct Nearest {
    float distance = 0;
    std::uint32_t triangle = kNone;
  };
  static constexpr std::uint32_t kNone = 0xffffffff;
  [[nodiscard]] Nearest nearest(const Eigen::Vector3f& x) const;

  float reach_;
  float cell_;
  TriangleMesh mesh_;
  std::unordered_map<CellKey, std::vector<std::uint32_t>> cells_;
};

/// Distance of a point to a triangle [m]  (Ericson, Real-Time Collision Detection, 5.1.5).
[[nodiscard]] float distance_to_triangle(const Eigen::Vector3f& x, const Eigen::Vector3f& a,
                                         const Eigen::Vector3f& b, const Eigen::Vector3f& c);

}  // namespace twofold
