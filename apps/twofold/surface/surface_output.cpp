#include "apps/twofold/surface/surface_output.hpp"

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cmath>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "apps/twofold/output/output_folder.hpp"
#include "base/counted.hpp"
#include "io/files/mesh_file.hpp"
#include "io/plots/plot.hpp"
#include "surface/mesh_picture.hpp"

namespace twofold {

namespace {

nlohmann::ordered_json live_mesh_json(const std::optional<LiveMeshFigures>& f) {
  if (!f) return nullptr;
  return {{"updates", f->updates},
          {"blocks_per_update", f->blocks_an_update},
          {"update_ms", f->update_ms},
          {"maps", f->maps},
          {"behind_p50_ms", f->behind_p50_ms},
          {"behind_p99_ms", f->behind_p99_ms},
          {"behind_max_ms", f->behind_max_ms},
          {"loops", f->loops},
          {"loop_max_ms", f->loop_max_ms},
          {"joined_max_ms", f->joined_max_ms},
          {"settled_max_ms", f->settled_max_ms},
          {"memory_mb", f->memory_mb}};
}

}  // namespace

void describe_volume(const SurfaceVolume& volume, SurfaceFigures& figures) {
  figures.voxel = volume.options().voxel;
  figures.blocks = volume.blocks().size();
  const double block = std::pow(kBlockEdge * figures.voxel, 3);  // [m^3]
  figures.mb_a_cubic_metre = static_cast<double>(volume.bytes()) / (1 << 20) /
                             std::max(1e-9, static_cast<double>(figures.blocks) * block);
}

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
          {"live_mesh", live_mesh_json(f.live_mesh)},
          {"left_out", f.left_out}};
}

void print_surface(const SurfaceFigures& f) {
  fmt::print(
      "surface     {} depth images fused, {:.1f} CPU-ms each, {} anew, {} triangles in {:.0f} CPU-ms, voxels "
      "of {:g} m\n",
      f.fused, f.fusion_ms, f.fused_anew, f.triangles, f.mesh_ms, f.voxel);
  fmt::print("            {}{}, {:.0f} MiB at most{}, colour: {}\n",
             f.submaps > 0 ? counted(f.submaps, "submap") + ", " : "", counted(f.blocks, "block"),
             f.memory_mb,
             f.blocks > 0 ? fmt::format(" ({:.0f} MiB for a cubic metre of blocks)", f.mb_a_cubic_metre) : "",
             f.colour);
  if (f.live_mesh) {
    const LiveMeshFigures& m = *f.live_mesh;
    fmt::print(
        "live mesh   behind the map by {:.0f} ms (p99 {:.0f}, max {:.0f}), {} updates of {:.0f} blocks, "
        "{:.0f} "
        "CPU-ms each, {:.0f} MiB\n",
        m.behind_p50_ms, m.behind_p99_ms, m.behind_max_ms, m.updates, m.blocks_an_update, m.update_ms,
        m.memory_mb);
    if (m.loops > 0)
      fmt::print(
          "            {} map changes (loops, pose graph) in the mesh after {:.0f} ms at most;\n"
          "            joined anew after {:.0f} ms, what they bent fused anew after {:.0f} ms\n",
          m.loops, m.loop_max_ms, m.joined_max_ms, m.settled_max_ms);
  }
  for (const std::string& what : f.left_out) fmt::print("left out    {}\n", what);
}

std::string no_mesh_reason(const SurfaceFigures& f, double max_depth) {
  const std::string what = "the depth images gave no surface: ";
  if (f.fused == 0)
    return what + (f.left_out.empty()
                       ? "there was none to fuse"
                       : fmt::format("none was fused, but left out: {}", fmt::join(f.left_out, "; ")));
  if (f.blocks == 0 && max_depth > 0)
    return what + fmt::format("no reading is within {:g} m (--max-depth)", max_depth);
  if (f.blocks == 0) return what + "their keyframes are not in the map any more";
  return what +
         fmt::format("voxels of {:g} m are too coarse for what was seen, or too fine for the depth's noise",
                     f.voxel);
}

void add_mesh_file_options(CLI::App& command, MeshFiles& files) {
  command.add_option("--obj", files.obj,
                     "Write the mesh to this OBJ file, too; its axes are surface.ply's: y points down, where "
                     "many programs take it for up");
  command.add_option("--picture", files.picture, "Draw the mesh to this PNG file");
}

void expect_places_for(const MeshFiles& files) {
  expect_place_for_file(files.obj, "--obj");
  expect_place_for_file(files.picture, "--picture");
}

void write_surface(const std::filesystem::path& folder, const TriangleMesh& mesh, const Vector3& up,
                   const MeshFiles& files) {
  constexpr int kWidth = 1600;
  std::error_code ignored;
  for (const char* name : {"surface.ply", "surface.glb"}) std::filesystem::remove(folder / name, ignored);
  if (mesh.triangles.empty()) return;
  write_ply_mesh(folder / "surface.ply", mesh);
  write_glb_mesh(folder / "surface.glb", mesh, up);
  if (!files.obj.empty()) write_obj_mesh(files.obj, mesh);
  if (!files.picture.empty())
    write_png(files.picture, draw_mesh(mesh, mesh.colours, overview_of(mesh, up, kWidth)));
}

}  // namespace twofold
