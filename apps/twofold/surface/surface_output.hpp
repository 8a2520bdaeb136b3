#pragma once

#include <CLI/App.hpp>
#include <cstdint>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "geometry/triangle_mesh.hpp"
#include "geometry/types.hpp"
#include "surface/volume.hpp"

namespace twofold {

/// What keeping the mesh up to date while a run lasts took. A version of the map is in the mesh when the
/// depth of its keyframes is, and the mesh has moved with what moved by more than two voxels.
struct LiveMeshFigures {
  std::int64_t updates = 0;     ///< that made blocks anew
  double blocks_an_update = 0;  ///< mean
  double update_ms = 0;         ///< processor time, mean; after fusion
  std::uint64_t maps = 0;       ///< versions of the map
  double behind_p50_ms = 0;     ///< from such a version's publication until it was in the mesh
  double behind_p99_ms = 0, behind_max_ms = 0;
  std::uint64_t loops = 0;    ///< versions with a correction of all poses: loops, pose graph
  double loop_max_ms = 0;     ///< until the mesh had moved with the submaps, the slowest
  double joined_max_ms = 0;   ///< until submaps that moved by more than two voxels had been joined anew, or
                              ///< the run's end; so below
  double settled_max_ms = 0;  ///< likewise until all submaps that were bent were in the mesh as fused anew
  double memory_mb = 0;       ///< of the joined samples and the mesh, at most [MiB]
};

/// What fusing depth into a surface took, and what it left out.
struct SurfaceFigures {
  double voxel = 0;             ///< [m]
  int fused = 0;                ///< depth images
  std::size_t submaps = 0;      ///< of a run; 0: all went into one volume
  int fused_anew = 0;           ///< of the depth images fused, because poses had changed
  double fusion_ms = 0;         ///< processor time of a depth image, mean
  double mesh_ms = 0;           ///< the same of extracting the mesh at the end
  std::size_t blocks = 0;       ///< of 8^3 samples
  double memory_mb = 0;         ///< of samples and depth images, at most [MiB]
  double mb_a_cubic_metre = 0;  ///< of samples, for each cubic metre of blocks [MiB]
  std::size_t triangles = 0;
  std::vector<std::string> left_out;  ///< in words
  std::string colour;                 ///< where the colours come from
  std::optional<LiveMeshFigures> live_mesh;
};

/// Fills in what the volume that the mesh is made of tells: voxel, blocks and mb_a_cubic_metre.
void describe_volume(const SurfaceVolume& volume, SurfaceFigures& figures);
[[nodiscard]] nlohmann::ordered_json surface_json(const SurfaceFigures& figures);
void print_surface(const SurfaceFigures& figures);

/// "the depth images gave no surface: " and why, where the mesh has no triangle: how none was fused, that
/// readings were too far away, or that voxels do not fit what was seen.
/// @param max_depth  SurfaceOptions::max_depth [m]
[[nodiscard]] std::string no_mesh_reason(const SurfaceFigures& figures, double max_depth);

/// Files of a mesh that are written only if asked for; empty: not.
struct MeshFiles {
  std::string obj;
  std::string picture;
};

/// --obj and --picture.
void add_mesh_file_options(CLI::App& command, MeshFiles& files);
/// Throws IoError naming the option whose file has no folder to be in.
void expect_places_for(const MeshFiles& files);

/// surface.ply and surface.glb in this folder, and the files asked for; those of an earlier run are removed
/// from the folder when there is no triangle. Throws IoError.
/// @param up  unit: what is shown upright
void write_surface(const std::filesystem::path& folder, const TriangleMesh& mesh,
                   const Vector3& up = -Vector3::UnitY(), const MeshFiles& files = {});

}  // namespace twofold
