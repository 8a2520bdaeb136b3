// What hours of browsing do to memory: a rendered desk, looked at forwards and backwards again and again at
// 30 Hz by its time stamps, as fast as the engine can; resident memory and the folder's files every ten
// minutes.
#include <CLI/CLI.hpp>
#include <atomic>
#include <exception>
#include <filesystem>
#include <memory>
#include <vector>

#include <fmt/format.h>

#include "engine/engine.hpp"
#include "engine/health.hpp"
#include "io/sources/synthetic_source.hpp"
#include "loopclosure/default_vocabulary.hpp"

namespace twofold {
namespace {

constexpr std::int64_t kPeriodNs = 33'333'333;
constexpr std::int64_t kFramesAnHour = 30 * 3600;

struct Arguments {
  double hours = 24;
  std::string folder;
  int width = 320, height = 240, frames = 300;
};

struct Scene {
  Rig rig;
  std::vector<Frame> frames;
};

Scene render(const Arguments& arguments) {
  const auto source = open_synthetic("desk", {{"width", std::to_string(arguments.width)},
                                              {"height", std::to_string(arguments.height)},
                                              {"frames", std::to_string(arguments.frames)}});
  Scene scene{source->rig(), {}};
  for (Frame frame; source->next(frame) == FrameStatus::kFrame;) scene.frames.push_back(frame);
  return scene;
}

/// Of a camera that goes to and fro.
std::size_t place_of(std::int64_t index, std::size_t frames) {
  const auto lap = static_cast<std::int64_t>(2 * (frames - 1));
  const auto at = static_cast<std::size_t>(index % lap);
  return at < frames ? at : static_cast<std::size_t>(lap) - at;
}

double folder_mib(const std::string& folder) {
  std::uintmax_t bytes = 0;
  if (folder.empty()) return 0;
  for (const auto& entry : std::filesystem::directory_iterator(folder)) bytes += entry.file_size();
  return static_cast<double>(bytes) / (1 << 20);
}

void run(const Arguments& arguments) {
  const Scene scene = render(arguments);
  EngineOptions options;
  options.vocabulary = std::make_shared<const Vocabulary>(load_default_vocabulary());
  options.logs.folder = arguments.folder;
  const auto end = static_cast<std::int64_t>(arguments.hours * static_cast<double>(kFramesAnHour));
  std::int64_t index = 0;
  const FrameFeed feed = [&](Frame& frame) {
    if (index == end) return FeedStatus::kEnd;
    frame = scene.frames[place_of(index, scene.frames.size())];
    frame.index = index;
    frame.t_ns = ++index * kPeriodNs;
    return FeedStatus::kFrame;
  };
  fmt::print("{:>7} {:>9} {:>9} {:>7} {:>9} {:>11}\n", "hours", "frames", "keyframes", "lost", "RSS MiB",
             "files MiB");
  const ProgressSink progress = [&](const Progress& p) {
    if (p.frames % (kFramesAnHour / 6) != 0) return;
    fmt::print("{:7.2f} {:9} {:9} {:7} {:9.2f} {:11.2f}\n",
               static_cast<double>(p.frames) / static_cast<double>(kFramesAnHour), p.frames, p.keyframes,
               p.lost, static_cast<double>(process_usage().rss_bytes) / (1 << 20),
               folder_mib(arguments.folder));
    std::fflush(stdout);
  };
  const std::atomic<bool> interrupted{false};
  const RunResult result = Engine(scene.rig, options).run(feed, interrupted, progress);
  if (!result.error.empty()) throw std::runtime_error(result.error);
  fmt::print(
      "in the end {} keyframes in the map, {} loops, {} frames on record, {:.0f} s, RSS {:.0f} MiB at most\n",
      result.graph.keyframe_count(), result.loops.size(), result.frames.size(), result.wall_seconds,
      result.peak_rss_mb);
}

}  // namespace
}  // namespace twofold

int main(int argc, char** argv) {
  CLI::App app{"What hours of browsing do to memory"};
  twofold::Arguments arguments;
  app.add_option("--hours", arguments.hours, "of 30 frames a second")->capture_default_str();
  app.add_option("--out", arguments.folder,
                 "folder that exists, for the run's logs; without, all is in memory");
  app.add_option("--width", arguments.width)->capture_default_str();
  app.add_option("--height", arguments.height)->capture_default_str();
  app.add_option("--frames", arguments.frames, "rendered")->capture_default_str();
  CLI11_PARSE(app, argc, argv);
  try {
    twofold::run(arguments);
  } catch (const std::exception& error) {
    fmt::print(stderr, "long_run: {}\n", error.what());
    return 2;
  }
}
