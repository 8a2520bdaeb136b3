// What lies between a camera's exposure and the pose: rendered stereo frames through a driver that keeps real
// time and loses what nobody fetches, after gaps of 0, 250 and 500 ms behind the first frame. Beside the
// truth, measured where poses come out, stands what the run itself reports.
#include <CLI/CLI.hpp>
#include <algorithm>
#include <atomic>
#include <vector>

#include <fmt/format.h>

#include "engine/engine.hpp"
#include "fixtures/punctual_camera.hpp"
#include "fixtures/side_by_side_camera.hpp"
#include "io/sources/synthetic_source.hpp"
#include "io/sources/v4l2_source.hpp"

namespace twofold {
namespace {

struct Scene {
  Rig rig;
  std::vector<std::vector<std::uint8_t>> images;
};

Scene render(int width, int height, int frames) {
  const auto source = open_synthetic("desk", {{"width", std::to_string(width)},
                                              {"height", std::to_string(height)},
                                              {"fps", "30"},
                                              {"frames", std::to_string(frames)}});
  Scene scene{source->rig(), {}};
  for (Frame frame; source->next(frame) == FrameStatus::kFrame;) {
    const cv::Mat both = testing::side_by_side(frame);
    scene.images.emplace_back(both.data, both.data + both.total());
  }
  return scene;
}

struct Measured {
  LatencyHistogram truth, reported, tracking;
  /// What the first consists of: until the reader has the frame, from there until the tracker begins with it,
  /// and from there until its pose is known.
  LatencyHistogram reading, waking, locating;
  std::uint64_t lost = 0;  ///< in the driver
  std::size_t dropped = 0;
};

Measured measure(const Scene& scene, int gap_ms) {
  auto driver = std::make_unique<PunctualCamera>();
  PunctualCamera& camera = *driver;
  testing::set_up_side_by_side(camera.device(), scene.rig, V4L2_PIX_FMT_GREY);
  camera.device().fps = 30;
  camera.device().frame = [&](std::uint64_t k) {
    FakeFrame frame;
    frame.bytes = scene.images[std::min<std::size_t>(k, scene.images.size() - 1)];
    return frame;
  };
  if (gap_ms > 0) camera.pauses = {{1, std::int64_t{gap_ms} * 1'000'000}};

  Measured measured;
  EngineOptions options;
  options.pacing = {.late = LatePolicy::kNewest, .live = true};
  // Of the frame that was read last and of the one that is tracked: a frame is read long after the pose of
  // the one before it, or it is dropped.
  std::atomic<std::int64_t> read_ns{0};
  std::int64_t begun_ns = 0, handed_over_ns = 0;  // tracker's
  options.before_step = [&](std::string_view name) {
    if (name != "tracker") return;
    begun_ns = camera.now_ns();
    handed_over_ns = read_ns.load(std::memory_order_relaxed);
  };
  options.on_pose = [&](const PoseReport& report) {
    const std::int64_t now_ns = camera.now_ns(), t_ns = report.record.t_ns;
    measured.truth.record(now_ns - t_ns);
    measured.reading.record(handed_over_ns - t_ns);
    measured.waking.record(begun_ns - handed_over_ns);
    measured.locating.record(now_ns - begun_ns);
  };
  V4l2Source source(parse_source_spec(testing::side_by_side_source(scene.rig)), {}, std::move(driver));
  const auto end = static_cast<std::int64_t>(scene.images.size());
  const FrameFeed feed = [&](Frame& frame) {
    if (source.next(frame) != FrameStatus::kFrame) return FrameStatus::kError;
    read_ns.store(camera.now_ns(), std::memory_order_relaxed);  // a figure; it publishes nothing
    return frame.index < end ? FrameStatus::kFrame : FrameStatus::kEnd;
  };
  std::atomic<bool> interrupted{false};
  RunResult result = Engine(scene.rig, options).run(feed, interrupted);
  measured.reported = exposure_to_pose(result);
  for (const FrameRecord& record : result.frames) {
    measured.dropped += record.state == FrameState::kDropped;
    if (record.state != FrameState::kDropped) measured.tracking.record(record.tracking_ns);
  }
  measured.lost = camera.lost();
  return measured;
}

std::string p50_p99(const LatencyHistogram& h) {
  return fmt::format("{:8.2f} {:8.2f}", static_cast<double>(h.quantile_ns(0.5)) * 1e-6,
                     static_cast<double>(h.quantile_ns(0.99)) * 1e-6);
}

void run(int width, int height, int frames) {
  const Scene scene = render(width, height, frames);
  fmt::print("{}x{} stereo, {} frames at 30 a second; p50 and p99 [ms]\n", width, height, frames);
  fmt::print("{:>6} {:>17} {:>17} {:>17} {:>17} {:>17} {:>17} {:>8} {:>8}\n", "gap ms", "exposure to pose",
             "as reported", "until it is read", "until it begins", "until the pose", "tracking, all", "lost",
             "dropped");
  for (const int gap_ms : {0, 250, 500}) {
    const Measured m = measure(scene, gap_ms);
    fmt::print("{:>6} {} {} {} {} {} {} {:>8} {:>8}\n", gap_ms, p50_p99(m.truth), p50_p99(m.reported),
               p50_p99(m.reading), p50_p99(m.waking), p50_p99(m.locating), p50_p99(m.tracking), m.lost,
               m.dropped);
  }
}

}  // namespace
}  // namespace twofold

int main(int argc, char** argv) {
  CLI::App app("Latency from a camera's exposure to the pose");
  int width = 640, height = 480, frames = 300;
  app.add_option("--width", width, "Of an image [px]")->capture_default_str();
  app.add_option("--height", height, "Of an image [px]")->capture_default_str();
  app.add_option("--frames", frames, "Of each run")->check(CLI::Range(10, 100000))->capture_default_str();
  CLI11_PARSE(app, argc, argv);
  twofold::run(width, height, frames);
  return 0;
}
