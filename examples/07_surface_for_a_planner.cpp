// Is the way ahead free? A surface of the keyframes' depth, asked as a planner asks, and written as a mesh.
//   07_surface_for_a_planner [SOURCE [MESH.glb]]
// A mesh's name ends in .glb, .ply or .obj. The latter two have the axes of the map, that of its first
// camera: y points down.
// The source has depth: RGB-D, or stereo.
//
// Four threads, as on a robot: this one has the frames and pushes them, and keeps each until its pose is
// known; the tracker's puts poses into a queue; the surface's reads that, and adds the frames of keyframes;
// the planner's asks the newest snapshot, and waits for none of them.
#include <algorithm>
#include <chrono>
#include <cstdio>
#include <deque>
#include <exception>
#include <future>
#include <mutex>
#include <optional>
#include <stop_token>
#include <string>
#include <thread>
#include <utility>
#include <variant>
#include <vector>

#include <sys/resource.h>

#include <twofold/pose_queue.hpp>
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

/// Frames whose poses are not known yet. A frame that shall be kept needs an owner (FrameView::owner), as
/// those of a Source have: who makes frames of his own copies the pixels, or hands over what holds them.
class KeptFrames {
 public:
  /// The lock is held over the push, since the pose may be there before it returns.
  twofold::PushResult push(twofold::Slam& slam, const twofold::FrameView& frame) {
    const std::scoped_lock lock(mutex_);
    twofold::PushResult pushed = slam.push(frame);
    if (pushed) frames_.emplace_back(pushed.frame, frame);
    if (frames_.size() > kMost) frames_.pop_front();  // the surface's thread is far behind
    return pushed;
  }
  /// The frame of that number, if it is still there; older ones are let go of: their poses were before it.
  std::optional<twofold::FrameView> take(std::int64_t number) {
    const std::scoped_lock lock(mutex_);
    std::optional<twofold::FrameView> frame;
    for (; !frames_.empty() && frames_.front().first <= number; frames_.pop_front())
      if (frames_.front().first == number) frame = std::move(frames_.front().second);
    return frame;
  }

 private:
  static constexpr std::size_t kMost = 64;
  std::mutex mutex_;
  std::deque<std::pair<std::int64_t, twofold::FrameView>> frames_;
};

/// The surface's thread, until the queue is closed.
void make_surface(twofold::PoseQueue& poses, KeptFrames& frames, const twofold::Slam& slam,
                  twofold::MapSurface& surface) {
  setpriority(PRIO_PROCESS, 0, 10);  // of this thread alone: the tracker goes first
  for (twofold::PoseOrEvent item; poses.next(item) == twofold::QueueStatus::kItem;) {
    const auto* pose = std::get_if<twofold::PoseEstimate>(&item);
    if (pose == nullptr) continue;
    const auto frame = frames.take(pose->frame);
    if (!frame || !pose->keyframe) continue;
    surface.add(*frame, pose->frame);
    const twofold::SurfaceUpdate update = surface.update(slam.map());  // loops move what is there
    if (update.beyond_memory + update.overtaken > 0)
      std::printf("%d keyframes are left out of the surface\n", update.beyond_memory + update.overtaken);
  }
}

/// The planner's thread, until it is stopped: half a metre ahead of where the camera is now.
void plan(const std::stop_token& stop, const twofold::Slam& slam, const twofold::MapSurface& surface) {
  while (!stop.stop_requested()) {
    std::this_thread::sleep_for(std::chrono::milliseconds(100));
    const auto pose = slam.latest();
    if (!pose) continue;
    const twofold::SurfaceSnapshot now = surface.snapshot();
    // Not pose->T_world_camera: a loop may have moved the world since this surface was made.
    const auto T_world_camera = now.camera_pose(*pose, slam.map());
    if (!T_world_camera) continue;
    const SpacePoint ahead = now.at(transform(*T_world_camera, {0, 0, 0.5}));
    std::printf("frame %lld: half a metre ahead is %s\n", static_cast<long long>(pose->frame),
                in_words(ahead.state));
  }
}

struct ClosesAtTheEnd {
  ~ClosesAtTheEnd() { queue.close(); }
  twofold::PoseQueue& queue;
};

int run(const std::string& name, const std::string& mesh) {
  twofold::Source source(name);
  twofold::PoseQueue poses;
  KeptFrames frames;
  twofold::Slam slam(source.rig(), {});
  twofold::MapSurface surface(slam.map(), {.model = {.voxel_size = 0.02}});  // before the first keyframe
  slam.on_pose([&](const twofold::PoseEstimate& pose) { poses.put(pose); });
  auto made = std::async(std::launch::async, [&] { make_surface(poses, frames, slam, surface); });
  const ClosesAtTheEnd closes{poses};  // before the surface's thread is waited for, whatever is thrown
  std::jthread planner([&](const std::stop_token& stop) { plan(stop, slam, surface); });
  for (twofold::FrameView frame; source.next(frame);) {
    if (!slam.wait_for_room(twofold::PoseQueue::kForEver)) break;  // a camera's frames do not wait
    frames.push(slam, frame);
  }
  const auto last = slam.latest();
  slam.finish();
  poses.close();
  made.get();  // throws what the surface's thread has thrown
  planner.request_stop();
  planner.join();
  surface.update(slam.map());
  const twofold::SurfaceSnapshot now = surface.snapshot();
  const auto T_world_camera = last ? now.camera_pose(*last) : std::nullopt;
  const bool known = T_world_camera && ask_ahead(now, *T_world_camera);
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
