// A camera that the kernel's driver vivid plays in a virtual machine, and what its frames' poses are late by:
// scripts/vm_latency.
//
//   virtual_camera render FILE   a stereo scene as raw grey images of 640x480, left and right beside each
//   other, and
//                                on standard output the source that captures them
//   virtual_camera judge         reads the poses of a run (--poses -) as they come, and prints how old they
//   are
#include <CLI/CLI.hpp>
#include <fstream>
#include <iostream>
#include <string>
#include <vector>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "engine/clock.hpp"
#include "engine/latency_histogram.hpp"
#include "fixtures/side_by_side_camera.hpp"
#include "io/sources/synthetic_source.hpp"

namespace twofold {
namespace {

// vivid shows 640x480 at 59.94 a second; the scene moves four times as slowly, because what a camera shows
// after an interruption is searched for by a machine that computes dozens of times more slowly.
constexpr int kWidth = 320, kHeight = 480, kFps = 240, kFrames = 120;
/// A camera that gave nothing for so long was away; 17 ms are usual.
constexpr std::int64_t kAway_ns = 90'000'000;
/// Fewer poses between two interruptions are part of them.
constexpr std::size_t kFewest = 60;

int render(const std::string& file) {
  const auto source = open_synthetic("desk", {{"width", std::to_string(kWidth)},
                                              {"height", std::to_string(kHeight)},
                                              {"fps", std::to_string(kFps)},
                                              {"frames", std::to_string(kFrames)}});
  std::ofstream raw(file, std::ios::binary);
  std::vector<cv::Mat> there;
  for (Frame frame; source->next(frame) == FrameStatus::kFrame;)
    there.push_back(testing::side_by_side(frame));
  // There and back, so that the camera that shows it again and again never jumps.
  std::vector<cv::Mat> shown = there;
  shown.insert(shown.end(), there.rbegin(), there.rend());
  for (const cv::Mat& both : shown)
    raw.write(reinterpret_cast<const char*>(both.data), static_cast<std::streamsize>(both.total()));
  raw.close();
  if (!raw) {
    fmt::print(stderr, "cannot write {}\n", file);
    return 1;
  }
  fmt::print("{}&size={}x{}&format=GREY\n", testing::side_by_side_source(source->rig()), 2 * kWidth, kHeight);
  return 0;
}

/// Poses without an interruption between them.
struct Stretch {
  LatencyHistogram said, arrived;
  std::size_t tracked = 0;
};

void print(const Stretch& stretch, std::int64_t away_ns) {
  const auto ms = [](const LatencyHistogram& h, double q) {
    return static_cast<double>(h.quantile_ns(q)) * 1e-6;
  };
  fmt::print("{:>9.0f} {:>6} {:>8} {:>9.2f} {:>9.2f} {:>9.2f} {:>9.2f}\n",
             static_cast<double>(away_ns) * 1e-6, stretch.said.count(), stretch.tracked,
             ms(stretch.said, 0.5), ms(stretch.said, 0.99), ms(stretch.arrived, 0.5),
             ms(stretch.arrived, 0.99));
}

int judge() {
  fmt::print("exposure to pose [ms]: as the run says it, and when another process had it\n");
  fmt::print("{:>9} {:>6} {:>8} {:>9} {:>9} {:>9} {:>9}\n", "away, ms", "poses", "tracked", "said p50", "p99",
             "here p50", "p99");
  Stretch stretch;
  std::int64_t exposed_before_ns = 0, away_ns = 0;
  for (std::string line; std::getline(std::cin, line);) {
    const std::int64_t arrived_ns = steady_now_ns();
    const auto pose = nlohmann::json::parse(line, nullptr, false);
    if (!pose.is_object() || !pose.contains("exposed_ns")) continue;
    const auto exposed_ns = pose["exposed_ns"].get<std::int64_t>();
    if (exposed_before_ns > 0 && exposed_ns - exposed_before_ns > kAway_ns) {
      if (stretch.said.count() >= kFewest) print(stretch, away_ns);
      stretch = {};
      away_ns = exposed_ns - exposed_before_ns;
    }
    exposed_before_ns = exposed_ns;
    stretch.said.record(pose["latency_ns"].get<std::int64_t>());
    stretch.arrived.record(arrived_ns - exposed_ns);
    stretch.tracked += pose["state"] == "tracked";
  }
  if (stretch.said.count() >= kFewest) print(stretch, away_ns);
  return exposed_before_ns > 0 ? 0 : 1;
}

}  // namespace
}  // namespace twofold

int main(int argc, char** argv) {
  CLI::App app("A camera of a virtual machine, and the latency of its poses");
  app.require_subcommand(1);
  std::string file;
  int status = 0;
  CLI::App* rendering = app.add_subcommand("render", "The images that the camera shows");
  rendering->add_option("FILE", file, "Raw grey images")->required();
  rendering->callback([&] { status = twofold::render(file); });
  app.add_subcommand("judge", "Poses, from standard input")->callback([&] { status = twofold::judge(); });
  CLI11_PARSE(app, argc, argv);
  return status;
}
