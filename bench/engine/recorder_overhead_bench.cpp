// What recording costs a frame of the tracker: the calls that TrackerRunner and ThreadedRun make for one
// frame (histograms, trace, schedule log, clock readings), and the share of that in a frame's tracking time.
#include <benchmark/benchmark.h>

#include <cmath>
#include <vector>

#include "engine/runners.hpp"
#include "fixtures/rendered_frames.hpp"

namespace twofold {
namespace {

constexpr int kFrames = 24;

Rig rig() {
  return testing::test_rig(SensorKind::kStereo);
}

SE3 T_c_w(int i) {
  return SE3(SO3::exp(Vector3(0, 0.01 * i, 0)), Vector3(-0.01 * i, 0, -0.02 * i));
}

const std::vector<Frame>& frames() {
  static const std::vector<Frame> all = testing::rendered_frames(rig(), T_c_w, kFrames);
  return all;
}

/// Mean time of a frame in the whole stage, everything recorded [ns].
double tracking_ns() {
  EngineOptions options;
  Trace trace;
  TrackerRunner tracking(rig(), options, &trace);
  MapperRunner mapping(rig(), options, nullptr);
  ProposalPool pool(4, [&](KeyframeProposal& proposal) { tracking.prepare(proposal); });
  GraphSnapshot graph = mapping.publish();
  std::int64_t sum = 0;
  for (const Frame& frame : frames()) {
    std::vector<ProposalHandle> proposal;
    proposal.push_back(pool.try_acquire());
    FrameRecord record;
    tracking.locate(frame, graph, EffortLevel::kEverything, proposal.front(), record);
    const bool proposed = tracking.prepare_next(record);
    sum += record.tracking_ns;
    if (!proposed) continue;
    (void)mapping.step(proposal);
    graph = mapping.publish();
  }
  return static_cast<double>(sum) / kFrames;
}

/// The recording of one frame and nothing else: stages, latency, counters, schedule, and the readings of the
/// clock that only they need.
void recorders_of_one_frame(benchmark::State& state) {
  static const double frame_ns = tracking_ns();
  Trace trace;
  StageRecorder times("tracker", &trace);
  std::vector<StageId> stages;
  for (std::size_t s = 0; s < kTrackerStages; ++s)
    stages.push_back(times.add_stage(describe(static_cast<TrackerStage>(s))));
  const StageId frame_stage = times.add_stage("frame");
  const StageId latency_stage = times.add_stage("latency");
  const TraceName version = times.add_counter("version");
  const TraceName effort = times.add_counter("effort level");
  ScheduleStream<TrackerStep> schedule;
  TrackerStep step;
  const std::int64_t begin_ns = steady_now_ns();
  for (auto _ : state) {
    // Laps of the stages, two for candidates; begin and end of the frame; the latency.
    std::int64_t now_ns = 0;
    for (std::size_t n = 0; n < kTrackerStages + 5; ++n) benchmark::DoNotOptimize(now_ns = steady_now_ns());
    times.record(frame_stage, now_ns, 12'345'678);
    for (const StageId stage : stages) times.record(stage, now_ns, 2'345'678);
    times.record(latency_stage, now_ns, 13'345'678);
    times.counter(version, static_cast<std::int64_t>(step.version));
    times.counter(effort, 0);
    ++step.frame;
    step.version += step.frame % 8 == 0;
    schedule.append(step);
  }
  const double ns = static_cast<double>(steady_now_ns() - begin_ns) / static_cast<double>(state.iterations());
  state.counters["tracking_ms"] = frame_ns * 1e-6;
  state.counters["share_percent"] = 100 * ns / frame_ns;
}
BENCHMARK(recorders_of_one_frame);

}  // namespace
}  // namespace twofold
