#include "slam/surface_pieces.hpp"

namespace twofold {

SurfaceMesh to_surface_mesh(const TriangleMesh& mesh) {
  SurfaceMesh plain;
  plain.positions.reserve(mesh.positions.size());
  plain.normals.reserve(mesh.normals.size());
  for (const Eigen::Vector3f& x : mesh.positions) plain.positions.push_back({x.x(), x.y(), x.z()});
  for (const Eigen::Vector3f& n : mesh.normals) plain.normals.push_back({n.x(), n.y(), n.z()});
  plain.colours = mesh.colours;
  plain.triangles = mesh.triangles;
  return plain;
}

std::vector<SurfacePiece> surface_pieces(const MeshPieces& mesh, std::uint64_t since) {
  std::vector<SurfacePiece> pieces;
  for (const BlockPosition& at : mesh.changed_since(since))
    pieces.push_back({{at.x, at.y, at.z}, to_surface_mesh(mesh.piece(at))});
  return pieces;
}

}  // namespace twofold
