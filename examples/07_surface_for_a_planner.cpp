// Is the way ahead free? A surface of the keyframes' depth, asked as a planner asks, and written as a mesh.
//   07_surface_for_a_planner [SOURCE [MESH.obj]]
// The mesh has the axes of the map, that of its first camera: y points down. Programs that take y for up show
// it upside down; (x, -y, -z) stands upright there.
// The source has depth: RGB-D, or stereo.
#include <algorithm>
#include <cstdint>
#include <cstdio>
#include <exception>
#include <fstream>
#include <map>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include <twofold/slam.hpp>
#include <twofold/source.hpp>
#include <twofold/surface.hpp>

namespace {

using twofold::SpacePoint;
using twofold::SpaceState;

/// What keyframes saw, in the world of the map part that the first of them is in, whatever name that has.
class Surroundings {
 public:
  explicit Surroundings(const twofold::CameraRig& rig) : model_(rig, {.voxel = 0.02}) {}

  void add(const twofold::FrameView& frame, const twofold::PoseEstimate& pose) {
    if (frames_.empty()) part_ = pose.map_part;
    if (pose.map_part != part_) return;
    frames_[pose.frame] = frame;  // its owner keeps the images
    model_.add(frame, pose.T_world_camera);
  }

  /// A surface stays where its poses put it; the map has corrected them since, and where it joined parts,
  /// either may have the other's name now.
  void correct(const twofold::MapSnapshot& map) {
    model_.clear();
    std::map<std::int64_t, twofold::FrameView> kept;
    for (const auto& keyframe : map.keyframes()) {
      const auto frame = frames_.find(keyframe.frame);
      if (frame == frames_.end()) continue;
      part_ = keyframe.part;
      model_.add(frame->second, keyframe.T_world_camera);
      kept.insert(*frame);
    }
    frames_ = std::move(kept);  // others are keyframes no more
  }

  [[nodiscard]] const twofold::SurfaceModel& model() const { return model_; }
  [[nodiscard]] std::uint32_t part() const { return part_; }

 private:
  twofold::SurfaceModel model_;
  std::map<std::int64_t, twofold::FrameView> frames_;
  std::uint32_t part_ = twofold::kNoId;
};

const char* in_words(SpaceState state) {
  if (state == SpaceState::kFree) return "free";
  return state == SpaceState::kOccupied ? "occupied" : "unknown";
}

/// Straight ahead of the camera: what is there, and how far a body of 5 cm around it could go. Near the
/// camera, where depth begins, nothing is known.
/// @return  something of it is known to be free
bool ask_ahead(const twofold::SurfaceModel& model, const twofold::Pose& T_world_camera) {
  constexpr int kSteps = 300;
  constexpr double kStep = 0.01, kRadius = 0.05;  // [m]
  std::vector<SpacePoint> way;
  const auto metres = [&](auto point) { return kStep * static_cast<double>(point - way.begin()); };
  for (int n = 0; n < kSteps; ++n) way.push_back(model.at(transform(T_world_camera, {0, 0, kStep * n})));
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

void write_obj(const std::string& file, const twofold::SurfaceMesh& mesh) {
  std::ofstream out(file);
  for (const auto& x : mesh.positions) out << "v " << x[0] << ' ' << x[1] << ' ' << x[2] << '\n';
  for (const auto& t : mesh.triangles) out << "f " << t[0] + 1 << ' ' << t[1] + 1 << ' ' << t[2] + 1 << '\n';
  if (!out.flush()) throw std::runtime_error(file + ": cannot be written");
  std::printf("%zu triangles written to %s\n", mesh.triangles.size(), file.c_str());
}

int run(const std::string& name, const std::string& mesh) {
  twofold::Source source(name);
  // All on one thread here. A robot's surface has a thread of its own: `add` takes 10 to 100 ms for a depth
  // image, more for a pair.
  twofold::Slam slam(source.rig(), {.mode = twofold::RunMode::kDeterministic});
  bool corrected = false;
  slam.on_event([&](const twofold::MapEvent& event) {
    corrected |=
        event.kind != twofold::MapEventKind::kNewPart && event.kind != twofold::MapEventKind::kRelocalisation;
  });
  Surroundings surroundings(source.rig());
  twofold::Pose T_world_camera;  // in the surroundings' world
  for (twofold::FrameView frame; source.next(frame);) {
    slam.push(frame);
    const auto pose = slam.latest();
    if (!pose || pose->state != twofold::TrackingState::kTracked) continue;
    if (corrected) surroundings.correct(slam.map());
    corrected = false;
    if (pose->keyframe) surroundings.add(frame, *pose);
    if (pose->map_part == surroundings.part()) T_world_camera = pose->T_world_camera;
  }
  const bool known = ask_ahead(surroundings.model(), T_world_camera);
  if (!mesh.empty()) write_obj(mesh, surroundings.model().mesh());
  return known ? 0 : 1;
}

}  // namespace

int main(int argc, char** argv) try {
  return run(argc > 1 ? argv[1] : "synthetic:desk?sensor=rgbd&frames=90", argc > 2 ? argv[2] : "");
} catch (const std::exception& error) {
  std::fprintf(stderr, "%s\n", error.what());
  return 1;
}
