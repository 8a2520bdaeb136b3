#include "slam/surface_pieces.hpp"

#include <cmath>
#include <stdexcept>

#include "io/files/mesh_file.hpp"

namespace twofold {
namespace {

TriangleMesh to_triangle_mesh(const SurfaceMesh& plain) {
  TriangleMesh mesh;
  for (const auto& x : plain.positions) mesh.positions.emplace_back(x[0], x[1], x[2]);
  for (const auto& n : plain.normals) mesh.normals.emplace_back(n[0], n[1], n[2]);
  mesh.colours = plain.colours;
  mesh.triangles = plain.triangles;
  return mesh;
}

}  // namespace

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

void save_mesh(const SurfaceMesh& mesh, const std::filesystem::path& file, const std::array<double, 3>& up) {
  const std::string kind = file.extension().string();
  if (kind == ".ply") return write_ply_mesh(file, to_triangle_mesh(mesh));
  if (kind == ".obj") return write_obj_mesh(file, to_triangle_mesh(mesh));
  if (kind != ".glb")
    throw std::invalid_argument(file.string() + ": the name must end in .ply, .obj or .glb");
  if (mesh.triangles.empty()) throw std::invalid_argument(file.string() + ": the mesh has no triangle");
  const Vector3 upright(up[0], up[1], up[2]);
  if (!(std::abs(upright.norm() - 1) < 1e-3)) throw std::invalid_argument("up is no unit vector");
  write_glb_mesh(file, to_triangle_mesh(mesh), upright.normalized());
}

}  // namespace twofold
