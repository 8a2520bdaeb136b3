#include "apps/twofold/surface/surface_output.hpp"

#include <fmt/format.h>

#include "io/files/mesh_file.hpp"

namespace twofold {

nlohmann::ordered_json surface_json(const SurfaceFigures& f) {
  return {{"voxel_m", f.voxel},
          {"depth_images_fused", f.fused},
          {"fused_anew", f.fused_anew},
          {"submaps", f.submaps},
          {"fusion_ms", f.fusion_ms},
          {"mesh_ms", f.mesh_ms},
          {"blocks", f.blocks},
          {"memory_mb", f.memory_mb},
          {"mb_per_cubic_metre", f.mb_a_cubic_metre},
          {"triangles", f.triangles},
          {"colour", f.colour},
          {"left_out", f.left_out}};
}

void print_surface(const SurfaceFigures& f) {
  fmt::print(
      "surface     {} depth images fused, {:.1f} CPU-ms each, {} anew, {} triangles in {:.0f} CPU-ms, voxels "
      "of {:g} m\n",
      f.fused, f.fusion_ms, f.fused_anew, f.triangles, f.mesh_ms, f.voxel);
  fmt::print(
      "            {}{} blocks, {:.0f} MB at most ({:.0f} MB for a cubic metre of blocks), colour: {}\n",
      f.submaps > 0 ? fmt::format("{} submaps, ", f.submaps) : "", f.blocks, f.memory_mb, f.mb_a_cubic_metre,
      f.colour);
  for (const std::string& what : f.left_out) fmt::print("left out    {}\n", what);
}

void write_surface(const std::filesystem::path& folder, const TriangleMesh& mesh) {
  std::error_code ignored;
  for (const char* name : {"surface.ply", "surface.glb"}) std::filesystem::remove(folder / name, ignored);
  if (mesh.triangles.empty()) return;
  write_ply_mesh(folder / "surface.ply", mesh);
  write_glb_mesh(folder / "surface.glb", mesh);
}

}  // namespace twofold
