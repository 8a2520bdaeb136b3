#pragma once

#include <cstdint>
#include <vector>

#include "surface/mesh_pieces.hpp"
#include "twofold/surface.hpp"

namespace twofold {

[[nodiscard]] SurfaceMesh to_surface_mesh(const TriangleMesh& mesh);

/// Pieces that changed after that revision, in cells of the edge of a block.
[[nodiscard]] std::vector<SurfacePiece> surface_pieces(const MeshPieces& mesh, std::uint64_t since);

}  // namespace twofold
