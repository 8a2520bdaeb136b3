// Poses of a stereo camera, while it moves:
//   01_webcam_poses "v4l2:/dev/video0?size=1280x480&fps=30&layout=side-by-side" stereo.yaml
// Without a camera, "synthetic:courtyard?frames=300" does.
#include <csignal>
#include <cstdio>
#include <exception>

#include <twofold/slam.hpp>
#include <twofold/source.hpp>

namespace {

volatile std::sig_atomic_t stop = 0;

void print(const twofold::PoseEstimate& pose) {
  if (pose.state != twofold::TrackingState::kTracked) {
    std::printf("%6lld  %s: %s\n", static_cast<long long>(pose.frame), to_string(pose.state), pose.reason);
    return;
  }
  const auto& t = pose.T_world_camera.t;
  std::printf("%6lld  %8.3f %8.3f %8.3f m   %.2f ms\n", static_cast<long long>(pose.frame), t[0], t[1], t[2],
              static_cast<double>(pose.latency_ns) * 1e-6);
}

int run(const char* name, const char* calibration) {
  twofold::Source camera(name, {.calibration = calibration});
  twofold::Slam slam(camera.rig(), {.live = camera.is_live()});
  // Corrections are rare: a line is little to ask of the thread of the tracker, which calls this.
  slam.on_event([](const twofold::MapEvent& event) {
    std::printf("        %s: the camera's place moved by %.3f m\n", to_string(event.kind), event.moved);
  });

  std::signal(SIGINT, [](int) { stop = 1; });
  twofold::FrameView frame;
  std::int64_t shown = -1;
  while (stop == 0 && camera.next(frame)) {
    if (!camera.is_live()) (void)slam.wait_for_room(1'000'000'000);
    if (const auto pushed = slam.push(frame); !pushed) std::printf("        %s\n", pushed.reason.c_str());
    // From any thread, at any time; printing in on_pose would hold the tracker up.
    if (const auto pose = slam.latest(); pose && pose->frame != shown) {
      print(*pose);
      shown = pose->frame;
    }
  }
  const twofold::SlamSummary summary = slam.finish();
  std::printf("%lld frames: %lld tracked, %lld lost, %lld dropped\n", static_cast<long long>(summary.frames),
              static_cast<long long>(summary.tracked), static_cast<long long>(summary.lost),
              static_cast<long long>(summary.dropped));
  return summary.tracked > 0 ? 0 : 1;
}

}  // namespace

int main(int argc, char** argv) try {
  const char* name = argc > 1 ? argv[1] : "v4l2:/dev/video0?size=1280x480&fps=30&layout=side-by-side";
  return run(name, argc > 2 ? argv[2] : "");
} catch (const std::exception& error) {
  std::fprintf(stderr, "%s\n", error.what());
  return 1;
}
