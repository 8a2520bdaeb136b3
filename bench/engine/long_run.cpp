// What hours in one place do to memory: a rendered scene again and again at 30 Hz by its time stamps, as fast
// as the engine can or at a multiple of that pace (--speed); resident memory and the folder's files every so
// many minutes. Of a desk the images are shown forwards and backwards, of a closed path (--closed) round by
// round.
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
  std::string folder, scene = "desk";
  bool closed = false, deterministic = false;
  double speed = 0;  ///< recorded seconds a second; 0: as fast as it goes
  int width = 320, height = 240, frames = 300;
  int minutes = 10;  ///< between two lines
};

struct Scene {
  Rig rig;
  std::vector<Frame> frames;
};

Scene render(const Arguments& arguments) {
  const auto source = open_synthetic(arguments.scene, {{"width", std::to_string(arguments.width)},
                                                       {"height", std::to_string(arguments.height)},
                                                       {"frames", std::to_string(arguments.frames)}});
  Scene scene{source->rig(), {}};
  for (Frame frame; source->next(frame) == FrameStatus::kFrame;) scene.frames.push_back(frame);
  return scene;
}

/// Of a camera that goes round, or to and fro.
std::size_t place_of(std::int64_t index, std::size_t frames, bool closed) {
  if (closed) return static_cast<std::size_t>(index) % frames;
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
  options.deterministic = arguments.deterministic;
  options.pacing.speed = arguments.speed;
  const auto end = static_cast<std::int64_t>(arguments.hours * static_cast<double>(kFramesAnHour));
  std::int64_t index = 0;
  const FrameFeed feed = [&](Frame& frame) {
    if (index == end) return FrameStatus::kEnd;
    frame = scene.frames[place_of(index, scene.frames.size(), arguments.closed)];
    frame.index = index;
    frame.t_ns = ++index * kPeriodNs;
    return FrameStatus::kFrame;
  };
  fmt::print("{:>7} {:>9} {:>9} {:>7} {:>9} {:>11}\n", "hours", "frames", "keyframes", "lost", "RSS MiB",
             "files MiB");
  const ProgressSink progress = [&](const Progress& p) {
    if (p.frames % (arguments.minutes * kFramesAnHour / 60) != 0) return;
    fmt::print("{:7.2f} {:9} {:9} {:7} {:9.2f} {:11.2f}\n",
               static_cast<double>(p.frames) / static_cast<double>(kFramesAnHour), p.frames, p.keyframes,
               p.lost, static_cast<double>(process_usage().rss_bytes) / (1 << 20),
               folder_mib(arguments.folder));
    std::fflush(stdout);
  };
  const std::atomic<bool> interrupted{false};
  const RunResult result = Engine(scene.rig, options).run(feed, interrupted, progress);
  if (!result.error.empty()) throw std::runtime_error(result.error);
  const GraphSnapshot& map = result.graph;
  std::size_t live = 0, observations = 0;
  for (std::size_t k = 0; k < map.keyframe_count(); ++k) {
    const Keyframe& keyframe = map.keyframe(KeyframeId(k));
    if (keyframe.culled()) continue;
    ++live;
    observations += keyframe.observations->size();
  }
  fmt::print(
      "in the end {} of {} keyframes in the map with {} observations, {} loops, {} frames on record, {:.0f} "
      "s, "
      "RSS {:.0f} MiB at most\n",
      live, map.keyframe_count(), observations, result.loops.size(), result.frames.size(),
      result.wall_seconds, result.peak_rss_mb);
}

}  // namespace
}  // namespace twofold

int main(int argc, char** argv) {
  CLI::App app{"What hours in one place do to memory"};
  twofold::Arguments arguments;
  app.add_option("--hours", arguments.hours, "of 30 frames a second")->capture_default_str();
  app.add_option("--out", arguments.folder,
                 "folder that exists, for the run's logs; without, all is in memory");
  app.add_option("--scene", arguments.scene)->capture_default_str();
  app.add_flag("--closed", arguments.closed, "its path is closed: round by round instead of to and fro");
  app.add_flag("--deterministic", arguments.deterministic,
               "one thread: the mapper is never behind, as at the recording's own pace");
  app.add_option("--speed", arguments.speed, "recorded seconds a second; 0: as fast as it goes")
      ->check(CLI::NonNegativeNumber)
      ->capture_default_str();
  app.add_option("--minutes", arguments.minutes, "of the recording between two lines")
      ->check(CLI::Range(1, 60))
      ->capture_default_str();
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
