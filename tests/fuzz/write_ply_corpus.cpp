// Writes small PLY files for the fuzzer to begin with: write_ply_corpus FOLDER
#include <filesystem>
#include <fstream>

#include "io/files/mesh_file.hpp"
#include "io/files/ply.hpp"

int main(int argc, char** argv) {
  using namespace twofold;
  if (argc != 2) return 2;
  const std::filesystem::path folder = argv[1];
  std::filesystem::create_directories(folder);
  TriangleMesh mesh;
  mesh.positions = {{0, 0, 0}, {1, 0, 0.5f}, {0, 1, 0}, {-1.25f, 1, 2}};
  mesh.triangles = {{0, 1, 2}, {0, 2, 3}};
  write_ply_mesh(folder / "plain", mesh);
  mesh.normals.assign(4, Eigen::Vector3f::UnitZ());
  mesh.colours = {{1, 2, 3}, {4, 5, 6}, {255, 0, 9}, {7, 8, 200}};
  mesh.sigmas.assign(4, 0.001f);
  write_ply_mesh(folder / "whole", mesh);
  mesh.triangles.clear();
  write_ply_mesh(folder / "cloud", mesh);
  write_ply(folder / "points", std::vector<PlyPoint>(2));
  std::ofstream(folder / "ascii") << "ply\r\nformat ascii 1.0\r\nelement vertex 3\r\nproperty double x\r\n"
                                     "property double y\r\nproperty double z\r\nproperty uchar red\r\n"
                                     "property uchar green\r\nproperty uchar blue\r\nelement face 1\r\n"
                                     "property uchar flags\r\nproperty list uchar int vertex_index\r\n"
                                     "end_header\r\n"
                                     "0 0 0 1 2 3\r\n1 0 0 4 5 6\r\n1 1 0 7 8 9\r\n7 3 0 1 2\r\n";
}
