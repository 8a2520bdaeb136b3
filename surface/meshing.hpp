#pragma once

#include <cstddef>

#include "geometry/triangle_mesh.hpp"
#include "surface/volume.hpp"

namespace twofold {

/// The surface of a volume by marching cubes, in the volume's frame: where the distance is 0, between samples
/// of at least options().min_weight. Blocks share the vertices on their borders, so that the mesh is closed
/// wherever the field is known; normals are the field's gradient, sigmas voxel / sqrt(weight), an upper
/// estimate. Pieces of fewer than options().min_triangles triangles are left out. Same volume, same bytes.
[[nodiscard]] TriangleMesh extract_mesh(const SurfaceVolume& volume);

/// Leaves out connected pieces of fewer than `least` triangles, then vertices that no triangle uses.
/// @return  triangles left out
std::size_t drop_small_pieces(TriangleMesh& mesh, int least);

/// Leaves out connected pieces that stand beside the largest one: whose middle lies farther from the upright
/// line through its middle than any of its vertices. Then vertices that no triangle uses.
/// @param up  unit
/// @return  triangles left out
std::size_t drop_pieces_beside(TriangleMesh& mesh, const Vector3& up);

}  // namespace twofold
