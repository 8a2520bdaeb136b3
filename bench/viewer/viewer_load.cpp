// A generated map in the viewer, for measurements in a browser: viewer_load POINTS [SECONDS [SPEED]]
// Rooms along a corridor, seen by keyframes every metre; a camera walks through it and back at SPEED
// (default: 1) times 30 frames a second. The number of each frame is the time of day it became known at [ms,
// 31 bits], so that the page can tell how long ago that was.
#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <random>
#include <thread>

#include "viewer/server.hpp"

namespace twofold {
namespace {

using Clock = std::chrono::steady_clock;
constexpr std::uint32_t kPointsAKeyframe = 250;

ViewMap generated_map(std::uint32_t points) {
  std::mt19937 rng(5);
  std::uniform_real_distribution<float> unit(0, 1);
  ViewMap map;
  map.version = 1;
  for (std::uint32_t p = 0; p < points; ++p) {
    const std::uint32_t k = p / kPointsAKeyframe;
    const bool wall = unit(rng) < 0.7F;
    const float side = unit(rng) < 0.5F ? -3.0F : 3.0F;
    const float along = static_cast<float>(k) + 4 * unit(rng);
    ViewPoint point{.id = p, .anchor = k, .observers = static_cast<std::uint8_t>(2 + rng() % 12)};
    point.position[0] = (wall ? side : 6 * unit(rng) - 3) + 40 * std::sin(along / 90);
    point.position[1] = wall ? 3 * unit(rng) - 1.5F : 1.5F;
    point.position[2] = along;
    map.points.push_back(point);
  }
  for (std::uint32_t k = 0; k * kPointsAKeyframe < points; ++k) {
    ViewKeyframe keyframe{.id = k, .frame = 30 * k, .t = static_cast<float>(k)};
    keyframe.position[0] = 40 * std::sin(static_cast<float>(k) / 90);
    keyframe.position[2] = static_cast<float>(k);
    keyframe.points = kPointsAKeyframe;
    keyframe.window = k < 25 ? 1 : k < 200 ? 2 : 0;
    map.keyframes.push_back(keyframe);
    if (k > 0) map.edges.push_back({.from = k - 1, .to = k, .shared_points = 60});
  }
  return map;
}

/// Frame n of a walk of a metre a second, along the corridor and back, and so on.
PoseEstimate pose_now(std::int64_t n, double length) {
  const auto now = std::chrono::duration_cast<std::chrono::milliseconds>(
      std::chrono::system_clock::now().time_since_epoch());
  const double walked = std::fmod(static_cast<double>(n) / 30, 2 * length);
  const double along = std::min(walked, 2 * length - walked);
  PoseEstimate pose;
  pose.frame = now.count() & 0x7fffffff;
  pose.t_ns = n * 33'333'333;
  pose.state = TrackingState::kTracked;
  pose.map_part = 0;
  pose.reference_keyframe = static_cast<std::uint32_t>(along);
  pose.T_world_camera.t = {40 * std::sin(along / 90), 0, along};
  return pose;
}

void run(std::uint32_t points, int seconds, int speed) {
  ViewScene scene;
  scene.begin(0);
  scene.show(generated_map(points));
  const ViewTitle title{.title = "generated map"};
  ViewServer server({.port = 0}, scene, title);
  std::printf("view at     %s\n", server.address().c_str());
  std::fflush(stdout);
  const auto begin = Clock::now();
  std::stop_source stop;
  std::int64_t n = 0;
  std::int64_t last_frame = -1;
  const auto tick = [&](const ViewServer::Audience&, ViewSight&) {
    const auto since = Clock::now() - begin;
    if (since > std::chrono::seconds(seconds)) stop.request_stop();
    for (; since * speed > n * std::chrono::nanoseconds(33'333'333); ++n) {
      PoseEstimate pose = pose_now(n, points / kPointsAKeyframe - 1);
      pose.frame = last_frame = std::max(pose.frame, last_frame + 1);
      scene.add(pose, {});
    }
    return std::nullopt;
  };
  server.run(stop.get_token(), tick, [] { return std::string("that was all"); });
}

}  // namespace
}  // namespace twofold

int main(int argc, char** argv) {
  twofold::run(static_cast<std::uint32_t>(argc > 1 ? std::atoi(argv[1]) : 2'000'000),
               argc > 2 ? std::atoi(argv[2]) : 60, argc > 3 ? std::atoi(argv[3]) : 1);
  return 0;
}
