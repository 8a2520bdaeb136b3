// What it costs tracker and mapper that users hold maps: a rendered courtyard at 30 Hz, while nobody holds
// one, while a thread holds one from the first second on, and while a thread takes a thousand a second. The
// three take turns, so that what else the machine does falls on all of them; each figure is the median over
// the turns.
#include <CLI/CLI.hpp>
#include <algorithm>
#include <array>
#include <chrono>
#include <thread>
#include <vector>

#include <fmt/format.h>

#include "twofold/slam.hpp"
#include "twofold/source.hpp"

namespace twofold {
namespace {

using Clock = std::chrono::steady_clock;

enum class Holder : std::uint8_t { kNobody, kOneForEver, kThousandASecond, kCount };
constexpr std::size_t kHolders = static_cast<std::size_t>(Holder::kCount);
constexpr std::array<const char*, kHolders> kNames{"nobody holds a map", "one is held all the time",
                                                   "1000 a second"};

struct Times {
  double frame_p50 = 0, frame_p99 = 0, publish_p99 = 0;  ///< [ms]
};

/// The holder's thread.
void hold(Holder holder, const Slam& slam, const std::stop_token& stop) {
  if (holder == Holder::kNobody) return;
  std::this_thread::sleep_for(std::chrono::seconds(1));
  const MapSnapshot held = slam.map();
  for (auto next = Clock::now(); !stop.stop_requested(); std::this_thread::sleep_until(next)) {
    next +=
        holder == Holder::kThousandASecond ? std::chrono::milliseconds(1) : std::chrono::milliseconds(100);
    if (holder == Holder::kThousandASecond) (void)slam.map().version();
  }
}

Times measure(Holder holder, const CameraRig& rig, const std::vector<FrameView>& frames) {
  Slam slam(rig, {.live = true});
  std::jthread user([&](const std::stop_token& stop) { hold(holder, slam, stop); });
  auto due = Clock::now();
  for (FrameView frame : frames) {
    std::this_thread::sleep_until(due);
    frame.t_ns = due.time_since_epoch().count();
    (void)slam.push(frame);
    due += std::chrono::nanoseconds(33'333'333);
  }
  user.request_stop();
  user.join();
  Times times;
  for (const StageTime& stage : slam.finish().timings) {
    if (stage.thread == "tracker" && stage.stage == "frame") {
      times.frame_p50 = stage.p50_ms;
      times.frame_p99 = stage.p99_ms;
    }
    if (stage.thread == "mapper" && stage.stage == "publish") times.publish_p99 = stage.p99_ms;
  }
  return times;
}

double median(const std::vector<Times>& turns, double Times::*figure) {
  std::vector<double> values;
  for (const Times& turn : turns) values.push_back(turn.*figure);
  std::sort(values.begin(), values.end());
  return values[values.size() / 2];
}

void run(int frame_count, int turns) {
  Source source(fmt::format("synthetic:courtyard?frames={}", frame_count), {.preload = true});
  std::vector<FrameView> frames;
  for (FrameView frame; source.next(frame);) frames.push_back(frame);
  std::array<std::vector<Times>, kHolders> times;
  for (int turn = 0; turn < turns; ++turn) {
    for (std::size_t h = 0; h < kHolders; ++h)
      times[h].push_back(measure(static_cast<Holder>(h), source.rig(), frames));
  }
  fmt::print("{:26} {:>10} {:>10} {:>12}   ratio of p99: frame, publish\n", "[ms]", "frame p50", "frame p99",
             "publish p99");
  for (std::size_t h = 0; h < kHolders; ++h) {
    const double frame = median(times[h], &Times::frame_p99), publish = median(times[h], &Times::publish_p99);
    fmt::print("{:26} {:10.3f} {:10.3f} {:12.4f}   {:.3f} {:.3f}\n", kNames[h],
               median(times[h], &Times::frame_p50), frame, publish,
               frame / median(times[0], &Times::frame_p99), publish / median(times[0], &Times::publish_p99));
  }
}

}  // namespace
}  // namespace twofold

int main(int argc, char** argv) {
  CLI::App app{"What it costs tracker and mapper that users hold maps"};
  int frames = 900, turns = 3;
  app.add_option("--frames", frames, "a run")->capture_default_str();
  app.add_option("--turns", turns, "runs of each sort")->capture_default_str();
  CLI11_PARSE(app, argc, argv);
  twofold::run(frames, turns);
}
