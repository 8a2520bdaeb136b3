// What a run of the engine holds for each keyframe: all of tracker, mapper, loop closer and result, one
// thread and one order.
#include <fmt/format.h>
#include <malloc.h>

#include <CLI/CLI.hpp>
#include <atomic>
#include <exception>
#include <memory>
#include <vector>

#include "engine/engine.hpp"
#include "io/sources/open_source.hpp"
#include "loopclosure/default_vocabulary.hpp"

namespace twofold {
namespace {

constexpr double kKiB = 1024;

struct Sample {
  std::int64_t frames = 0, keyframes = 0;
  double heap = 0;  ///< [bytes]
};

/// Blocks in use, those of the allocator's caches included, of which there are few.
double heap_bytes() {
  const struct mallinfo2 info = mallinfo2();
  return static_cast<double>(info.uordblks + info.hblkhd);
}

struct MeasuredRun {
  std::vector<Sample> samples;  ///< whenever there was a new keyframe
  RunResult result;
};

MeasuredRun measure(const std::string& text) {
  const std::unique_ptr<FrameSource> source = open_source(text);
  EngineOptions options;
  options.deterministic = true;
  options.vocabulary = std::make_shared<const Vocabulary>(load_default_vocabulary());
  const FrameFeed feed = [&](Frame& frame) { return source->next(frame); };
  MeasuredRun run;
  run.samples.reserve(100000);
  const ProgressSink progress = [&](const Progress& p) {
    if (run.samples.empty() || run.samples.back().keyframes < p.keyframes)
      run.samples.push_back({p.frames, p.keyframes, heap_bytes()});
  };
  const std::atomic<bool> interrupted{false};
  run.result = Engine(source->rig(), options).run(feed, interrupted, progress);
  if (!source->error().empty()) throw std::runtime_error(source->error());
  if (!run.result.error.empty()) throw std::runtime_error(text + ": " + run.result.error);
  return run;
}

/// What grows with the time, not with the place.
void print_records(const RunResult& result) {
  const auto line = [](const char* what, std::size_t count, std::size_t bytes) {
    fmt::print("          on record: {:>9} {:<12} {:9.2f} MiB\n", count, what,
               static_cast<double>(bytes) / (kKiB * kKiB));
  };
  const ScheduleStreams& schedule = result.schedule;
  line("frames", result.frames.size(), result.frames.size() * sizeof(FrameRecord));
  line("corrections", result.corrections.size(), result.corrections.size() * sizeof(PoseCorrection));
  line("loops", result.loops.size(), result.loops.size() * sizeof(ClosedLoop));
  line(
      "steps", schedule.tracker.records() + schedule.mapper.records() + schedule.loop_closer.records(),
      schedule.tracker.bytes().size() + schedule.mapper.bytes().size() + schedule.loop_closer.bytes().size());
}

void print(const std::string& text, const MeasuredRun& run) {
  const std::vector<Sample>& samples = run.samples;
  if (samples.size() < 4) throw std::runtime_error(text + ": too few keyframes to tell");
  fmt::print("{}\n{:>9} {:>9} {:>9} {:>15}\n", text, "keyframes", "frames", "heap MiB", "KiB a keyframe");
  const Sample* before = nullptr;
  for (std::size_t n = samples.size() / 8; n < samples.size(); n = 2 * n + 1) {
    const Sample& at = samples[n];
    fmt::print("{:9} {:9} {:9.2f}", at.keyframes, at.frames, at.heap / (kKiB * kKiB));
    if (before != nullptr)
      fmt::print(" {:15.1f}",
                 (at.heap - before->heap) / kKiB / static_cast<double>(at.keyframes - before->keyframes));
    fmt::print("\n");
    before = &at;
  }
  const GraphSnapshot& graph = run.result.graph;
  std::size_t living = 0;
  for (std::uint32_t k = 0; k < graph.keyframe_count(); ++k)
    living += !graph.keyframe(KeyframeId{k}).culled();
  fmt::print("          in the end {} of {} keyframes are in the map\n", living, graph.keyframe_count());
  print_records(run.result);
}

}  // namespace
}  // namespace twofold

int main(int argc, char** argv) {
  CLI::App app("Memory a keyframe in runs of the engine");
  std::vector<std::string> sources{"synthetic:courtyard?rounds=1"};
  app.add_option("SOURCE", sources, "Sources of frames, as `twofold run` takes them");
  CLI11_PARSE(app, argc, argv);
  try {
    for (const std::string& source : sources) twofold::print(source, twofold::measure(source));
  } catch (const std::exception& error) {
    fmt::print(stderr, "run_memory: {}\n", error.what());
    return 2;
  }
}
