// Is the way ahead free? A surface of the keyframes' depth, asked as a planner asks, and written as a mesh.
//   07_surface_for_a_planner [SOURCE [MESH.glb]]
// A mesh's name ends in .glb, .ply or .obj. The latter two have the axes of the map, that of its first
// camera: y points down.
// The source has depth: RGB-D, or stereo.
#include <algorithm>
#include <cstdio>
#include <exception>
#include <string>
#include <vector>

#include <twofold/slam.hpp>
#include <twofold/source.hpp>
#include <twofold/surface.hpp>

namespace {

using twofold::SpacePoint;
using twofold::SpaceState;

const char* in_words(SpaceState state) {
  if (state == SpaceState::kFree) return "free";
  return state == SpaceState::kOccupied ? "occupied" : "unknown";
}

/// Straight ahead of the camera: what is there, and how far a body of 5 cm around it could go. Near the
/// camera, where depth begins, nothing is known.
/// @return  something of it is known to be free
bool ask_ahead(const twofold::SurfaceSnapshot& surface, const twofold::Pose& T_world_camera) {
  constexpr int kSteps = 300;
  constexpr double kStep = 0.01, kRadius = 0.05;  // [m]
  std::vector<SpacePoint> way;
  const auto metres = [&](auto point) { return kStep * static_cast<double>(point - way.begin()); };
  for (int n = 0; n < kSteps; ++n) way.push_back(surface.at(transform(T_world_camera, {0, 0, kStep * n})));
  for (auto begin = way.begin(); begin != way.end();) {
    const auto end =
        std::find_if(begin, way.end(), [&](const SpacePoint& p) { return p.state != begin->state; });
    std::printf("%.2f to %.2f m ahead: %s\n", metres(begin), metres(end), in_words(begin->state));
    begin = end;
  }

  const auto is_free = [](const SpacePoint& p) { return p.state == SpaceState::kFree; };
  const auto begin = std::find_if(way.begin(), way.end(), is_free);
  auto stop = std::find_if_not(begin, way.end(), is_free);  // where nobody looked, too
  while (stop != begin && (stop - 1)->distance < kRadius) --stop;
  if (stop == begin) return false;
  const SpacePoint& last = *(stop - 1);
  std::printf("free to go until %.2f m: there at least %.3f m from a surface", metres(stop - 1),
              last.distance);
  if (last.gradient != twofold::SpacePoint().gradient)  // near enough to tell
    std::printf(", more towards (%.2f %.2f %.2f)", last.gradient[0], last.gradient[1], last.gradient[2]);
  std::printf("\n");
  return true;
}

void write_mesh(const std::string& file, const twofold::SurfaceMesh& mesh) {
  save_mesh(mesh, file);
  std::printf("%zu triangles written to %s\n", mesh.triangles.size(), file.c_str());
}

int run(const std::string& name, const std::string& mesh) {
  twofold::Source source(name);
  // All on one thread here. A robot's surface has a thread of its own: `update` takes 10 to 100 ms for a
  // keyframe; planners ask snapshots, on theirs.
  twofold::Slam slam(source.rig(), {.mode = twofold::RunMode::kDeterministic});
  twofold::MapSurface surface(slam.map(), {.model = {.voxel_size = 0.02}});
  twofold::Pose T_world_camera;
  for (twofold::FrameView frame; source.next(frame);) {
    slam.push(frame);
    const auto pose = slam.latest();
    if (!pose || pose->state != twofold::TrackingState::kTracked) continue;
    T_world_camera = pose->T_world_camera;
    if (!pose->keyframe) continue;
    surface.add(frame, pose->frame);
    surface.update(slam.map());  // loops move what is there
  }
  const twofold::SurfaceSnapshot now = surface.snapshot();
  const bool known = ask_ahead(now, T_world_camera);
  if (!mesh.empty()) write_mesh(mesh, now.mesh());
  return known ? 0 : 1;
}

}  // namespace

int main(int argc, char** argv) try {
  return run(argc > 1 ? argv[1] : "synthetic:desk?sensor=rgbd&frames=90", argc > 2 ? argv[2] : "");
} catch (const std::exception& error) {
  std::fprintf(stderr, "%s\n", error.what());
  return 1;
}
