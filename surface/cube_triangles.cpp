#include "surface/cube_triangles.hpp"

#include <utility>

namespace twofold {
namespace {

using Triangles = std::vector<std::array<std::uint8_t, 3>>;
constexpr int kNoEdge = -1;

// Corners of each face, anticlockwise seen from outside the cell.
constexpr int kFaces[6][4] = {{0, 4, 6, 2}, {1, 3, 7, 5}, {0, 1, 5, 4},
                              {2, 6, 7, 3}, {0, 2, 3, 1}, {4, 5, 7, 6}};

int edge_between(int a, int b) {
  for (int e = 0; e < kCubeEdges; ++e) {
    const CubeEdge& edge = cube_edges()[static_cast<std::size_t>(e)];
    if ((edge.corner == a && edge.other() == b) || (edge.corner == b && edge.other() == a)) return e;
  }
  return kNoEdge;
}

/// For each edge that the surface crosses, the next one round its outline. Every such edge is entered from
/// exactly one of its two faces: the outlines close.
std::array<int, kCubeEdges> trace_faces(unsigned inside) {
  std::array<int, kCubeEdges> next;
  next.fill(kNoEdge);
  const auto is_inside = [&](int corner) { return (inside >> corner & 1U) != 0; };
  for (const auto& face : kFaces) {
    for (int i = 0; i < 4; ++i) {
      if (is_inside(face[i]) || !is_inside(face[(i + 1) % 4])) continue;
      int last = i + 1;  // of the corners inside that follow
      while (is_inside(face[(last + 1) % 4])) ++last;
      const int entered = edge_between(face[i], face[(i + 1) % 4]);
      const int left = edge_between(face[last % 4], face[(last + 1) % 4]);
      next[static_cast<std::size_t>(entered)] = left;
    }
  }
  return next;
}

Triangles triangles_of(unsigned inside) {
  std::array<int, kCubeEdges> next = trace_faces(inside);
  Triangles triangles;
  for (int first = 0; first < kCubeEdges; ++first) {
    std::vector<int> outline;
    for (int e = first; next[static_cast<std::size_t>(e)] != kNoEdge;) {
      outline.push_back(e);
      e = std::exchange(next[static_cast<std::size_t>(e)], kNoEdge);
    }
    for (std::size_t i = 2; i < outline.size(); ++i)
      triangles.push_back({static_cast<std::uint8_t>(outline[0]), static_cast<std::uint8_t>(outline[i - 1]),
                           static_cast<std::uint8_t>(outline[i])});
  }
  return triangles;
}

}  // namespace

const std::array<CubeEdge, kCubeEdges>& cube_edges() {
  static const auto kEdges = [] {
    std::array<CubeEdge, kCubeEdges> edges;
    std::size_t n = 0;
    for (int corner = 0; corner < kCubeCorners; ++corner)
      for (int axis = 0; axis < 3; ++axis)
        if ((corner >> axis & 1) == 0) edges[n++] = {corner, axis};
    return edges;
  }();
  return kEdges;
}

const Triangles& cube_triangles(unsigned inside) {
  static const auto kTable = [] {
    std::array<Triangles, 256> table;
    for (unsigned i = 0; i < 256; ++i) table[i] = triangles_of(i);
    return table;
  }();
  return kTable[inside & 255U];
}

}  // namespace twofold
