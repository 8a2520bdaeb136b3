#pragma once

#include <filesystem>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "geometry/triangle_mesh.hpp"

namespace twofold {

/// What fusing depth into a surface took, and what it left out.
struct SurfaceFigures {
  double voxel = 0;             ///< [m]
  int fused = 0;                ///< depth images
  std::size_t submaps = 0;      ///< of a run; 0: all went into one volume
  int fused_anew = 0;           ///< of these, because poses had changed
  double fusion_ms = 0;         ///< processor time of a depth image, mean
  double mesh_ms = 0;           ///< the same of extracting the mesh at the end
  std::size_t blocks = 0;       ///< of 8^3 samples
  double memory_mb = 0;         ///< of samples and depth images, at most
  double mb_a_cubic_metre = 0;  ///< of samples, for each cubic metre of blocks
  std::size_t triangles = 0;
  std::vector<std::string> left_out;  ///< in words
  std::string colour;                 ///< where the colours come from
};

[[nodiscard]] nlohmann::ordered_json surface_json(const SurfaceFigures& figures);
void print_surface(const SurfaceFigures& figures);

/// surface.ply and surface.glb in this folder; those of an earlier run are removed when there is no triangle.
/// Throws IoError.
void write_surface(const std::filesystem::path& folder, const TriangleMesh& mesh);

}  // namespace twofold
