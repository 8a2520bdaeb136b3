#pragma once

#include <array>
#include <cstdint>
#include <vector>

namespace twofold {

/// Corner c of a cell stands at (c & 1, c >> 1 & 1, c >> 2).
inline constexpr int kCubeCorners = 8;
inline constexpr int kCubeEdges = 12;

/// Edge of a cell: from its lower corner along an axis.
struct CubeEdge {
  int corner = 0;  ///< the lower end
  int axis = 0;    ///< 0 x, 1 y, 2 z
  [[nodiscard]] int other() const { return corner | 1 << axis; }
};
[[nodiscard]] const std::array<CubeEdge, kCubeEdges>& cube_edges();

/// Triangles of a cell as triples of edges, going round anticlockwise seen from outside; bit c of `inside`
/// says that corner c is inside  (marching cubes, Lorensen and Cline, SIGGRAPH 1987).
///
/// Made from the faces: on each, corners inside that are neighbours share a piece of the outline. Where two
/// lie diagonally they are kept apart, on both sides of the face alike, so that cells fit together without
/// holes.
[[nodiscard]] const std::vector<std::array<std::uint8_t, 3>>& cube_triangles(unsigned inside);

}  // namespace twofold
