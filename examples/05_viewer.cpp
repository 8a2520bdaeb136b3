// A run in a browser while it runs:
//   05_viewer [SOURCE [SECONDS_TO_STAY]]
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <exception>
#include <thread>

#include <twofold/slam.hpp>
#include <twofold/source.hpp>
#include <twofold/viewer.hpp>

namespace {

/// The viewer is called until the run is finished, which therefore comes first, whatever is thrown.
struct FinishFirst {
  twofold::Slam& slam;
  ~FinishFirst() { (void)slam.finish(); }
};

void run(const char* name, int seconds_to_stay) {
  twofold::Source source(name);
  twofold::Slam slam(source.rig(), {.live = source.is_live()});
  twofold::Viewer viewer(source.rig(), [&] { return slam.map(); },
                         {.title = name,
                          .port = 0,
                          .stages = twofold::tracker_stages(),
                          .efforts = twofold::effort_levels(),
                          .paced_by = source.is_live() ? "camera" : ""});
  const FinishFirst finish_first{slam};
  slam.on_frame([&](const twofold::PoseEstimate& pose, const twofold::FrameDetails& details) {
    viewer.tell(pose, details);
  });
  slam.on_event([&](const twofold::MapEvent& event) { viewer.tell(event); });
  std::printf("open %s\n", viewer.address().c_str());

  twofold::FrameView frame;
  while (source.next(frame)) {
    if (!source.is_live()) (void)slam.wait_for_room(1'000'000'000);
    const twofold::PushResult pushed = slam.push(frame);
    if (pushed && viewer.wants_image()) viewer.show(pushed.frame, frame.left, frame.owner);
  }
  const twofold::SlamSummary summary = slam.finish();
  std::printf("%lld of %lld frames tracked\n", static_cast<long long>(summary.tracked),
              static_cast<long long>(summary.frames));
  std::this_thread::sleep_for(std::chrono::seconds(seconds_to_stay));
}

}  // namespace

int main(int argc, char** argv) try {
  run(argc > 1 ? argv[1] : "synthetic:courtyard?frames=300", argc > 2 ? std::atoi(argv[2]) : 60);
} catch (const std::exception& error) {
  std::fprintf(stderr, "%s\n", error.what());
  return 1;
}
