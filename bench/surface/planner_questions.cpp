// What the surface of a run costs its own thread, and how long a planner waits:  planner_questions SOURCE
// [VOXEL]
//
// A deterministic run; after each keyframe MapSurface::update, and every tenth keyframe a new snapshot,
// which is prepared, and then asked for a position and for a box of 2 m around the camera.
#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <exception>
#include <string>
#include <vector>

#include "base/processor_time.hpp"
#include "twofold/slam.hpp"
#include "twofold/source.hpp"
#include "twofold/surface.hpp"

namespace twofold {
namespace {

constexpr int kAskedEvery = 10;    // keyframes
constexpr double kMegabyte = 1e6;  // [bytes]

/// Of what a call took.
class Times {
 public:
  template <class Call>
  auto of(const Call& call) {
    const std::int64_t begin_ns = thread_cpu_ns();
    auto answer = call();
    ms_.push_back(1e-6 * static_cast<double>(thread_cpu_ns() - begin_ns));
    return answer;
  }
  void print(const char* name) {
    if (ms_.empty()) return;
    const double last = ms_.back();
    std::sort(ms_.begin(), ms_.end());
    double sum = 0;
    for (const double one : ms_) sum += one;
    std::printf("| %s | %zu | %.3f | %.3f | %.3f | %.3f |\n", name, ms_.size(),
                sum / static_cast<double>(ms_.size()), ms_[ms_.size() / 2], ms_.back(), last);
  }

 private:
  std::vector<double> ms_;
};

class Planner {
 public:
  void ask(const MapSurface& surface, const Pose& T_world_camera) {
    const std::array<double, 3> ahead = transform(T_world_camera, {0, 0, 1});
    const SurfaceSnapshot now = taken_.of([&] { return surface.snapshot(); });
    prepared_.of([&] { return now.prepare(), 0; });
    free_ += at_.of([&] { return now.at(ahead); }).state == SpaceState::kFree;
    DistanceBox box{.resolution = 0.05};
    for (std::size_t axis = 0; axis < 3; ++axis) {
      box.min_corner[axis] = T_world_camera.t[axis] - 1;
      box.max_corner[axis] = T_world_camera.t[axis] + 1;
    }
    (void)box_.of([&] { return now.distances(box); });
    bytes_ = now.memory_bytes();
  }
  void print() {
    taken_.print("snapshot()");
    prepared_.print("prepare()");
    at_.print("a position");
    box_.print("a box of 80^3 cells");
    std::printf("a metre ahead is free %d times; the last snapshot keeps %.1f MB\n", free_,
                static_cast<double>(bytes_) / kMegabyte);
  }

 private:
  Times taken_, prepared_, at_, box_;
  int free_ = 0;
  std::size_t bytes_ = 0;
};

void run(const std::string& name, double voxel) {
  Source source(name);
  Slam slam(source.rig(), {.mode = RunMode::kDeterministic});
  MapSurface surface(slam.map(), {.model = {.voxel_size = voxel}});
  Times added, updated;
  Planner planner;
  int keyframes = 0;
  for (FrameView frame; source.next(frame);) {
    slam.push(frame);
    const auto pose = slam.latest();
    if (!pose || !pose->keyframe) continue;
    added.of([&] { return surface.add(frame, pose->frame), 0; });
    updated.of([&] { return surface.update(slam.map()), 0; });
    if (++keyframes % kAskedEvery == 0) planner.ask(surface, pose->T_world_camera);
  }
  std::printf("| CPU-ms | calls | mean | median | most | last |\n|---|---|---|---|---|---|\n");
  added.print("add");
  updated.print("update");
  planner.print();
  std::printf("the surface keeps %.1f MB\n", static_cast<double>(surface.memory_bytes()) / kMegabyte);
}

}  // namespace
}  // namespace twofold

int main(int argc, char** argv) try {
  const double voxel = argc > 2 ? std::atof(argv[2]) : 0.02;
  if (argc < 2 || !(voxel > 0)) {
    std::fprintf(stderr, "planner_questions SOURCE [VOXEL]\n");
    return 2;
  }
  twofold::run(argv[1], voxel);
  return 0;
} catch (const std::exception& error) {
  std::fprintf(stderr, "%s\n", error.what());
  return 1;
}
