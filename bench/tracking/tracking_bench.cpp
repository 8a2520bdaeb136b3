// Dense alignment and motion-only bundle adjustment as the tracker calls them, on each effort level,
// and the tracker as a whole.
#include <benchmark/benchmark.h>

#include <random>
#include <vector>

#include "fixtures/plain_map.hpp"
#include "fixtures/rendered_frames.hpp"
#include "tracking/effort_bounds.hpp"
#include "tracking/tracker.hpp"

namespace twofold {
namespace {

constexpr int kFrames = 24;

SE3 T_c_w(int i) {
  const double s = 0.03 * i;
  return SE3(SO3::exp(Vector3(0.05 * std::sin(3 * s), 0.2 * std::sin(1.5 * s), 0)),
             Vector3(0.5 * std::sin(s), 0.1 * std::sin(2 * s), s))
      .inverse();
}

Rig rig() {
  return testing::test_rig(SensorKind::kStereo);
}

const std::vector<Frame>& frames() {
  static const std::vector<Frame> all = testing::rendered_frames(rig(), T_c_w, kFrames);
  return all;
}

void dense_alignment(benchmark::State& state) {
  const TrackerOptions options;
  const auto effort = static_cast<EffortLevel>(state.range(0));
  const EffortBounds bounds = bounds_of(effort, options);
  const testing::RenderedScene scene(rig(), {3, 2, 5}, 21);
  const SE3 T_w_previous = T_c_w(4).inverse();
  ImagePyramid previous, current;
  previous.build(frames()[4].left);
  current.build(frames()[5].left);
  std::vector<AlignmentPoint> points;
  std::mt19937 random(3);
  for (int n = 0; n < 240; ++n) {
    const Vector2 uv(std::uniform_int_distribution(20, 620)(random),
                     std::uniform_int_distribution(20, 460)(random));
    points.push_back({uv.cast<float>(), rig().camera.unproject(uv) * scene.depth(T_c_w(4), uv)});
  }
  DenseAlignment alignment(points.size(), options.alignment);
  DenseAlignmentResult result;
  for (auto _ : state) {
    result = alignment.align(rig().camera, previous, current, points, SE3(), bounds.finest_alignment_level);
  }
  const SE3 error = result.T_cur_prev * (T_c_w(5) * T_w_previous).inverse();
  state.counters["error_mm"] = 1e3 * error.translation().norm();
  state.SetLabel(describe(effort));
}
BENCHMARK(dense_alignment)
    ->ArgName("effort level")
    ->Arg(static_cast<int>(EffortLevel::kEverything))
    ->Arg(static_cast<int>(EffortLevel::kCoarseAlignment))
    ->Unit(benchmark::kMicrosecond);

void motion_only(benchmark::State& state) {
  const TrackerOptions options;
  const auto effort = static_cast<EffortLevel>(state.range(0));
  const EffortBounds bounds = bounds_of(effort, options);
  MotionOnlyOptions solver = options.pose.motion;
  solver.max_iterations = bounds.motion_iterations;
  const SE3 T_true = T_c_w(1) * T_c_w(0).inverse();
  std::mt19937 random(5);
  std::normal_distribution<double> noise(0, rig().noise.sigma_px);
  std::vector<MotionObservation> observations;
  for (int n = 0; n < bounds.wanted_matches; ++n) {
    const Vector2 uv(std::uniform_real_distribution(20.0, 620.0)(random),
                     std::uniform_real_distribution(20.0, 460.0)(random));
    const Vector3 x = rig().camera.unproject(uv) * std::uniform_real_distribution(1.0, 6.0)(random);
    StereoPixel z = rig().project(T_true * x) + Vector3(noise(random), noise(random), noise(random));
    if (n % 10 == 0) z += Vector3(15, -9, 0);  // a wrong match
    observations.push_back(observe_point(rig(), x, z.cast<float>(), 0));
  }
  std::vector<MotionObservation> copy;
  for (auto _ : state) {
    copy = observations;
    benchmark::DoNotOptimize(optimise_motion(rig(), copy, SE3(), solver));
  }
  state.SetLabel(describe(effort));
}
BENCHMARK(motion_only)
    ->ArgName("effort level")
    ->Arg(static_cast<int>(EffortLevel::kEverything))
    ->Arg(static_cast<int>(EffortLevel::kFewerPoints))
    ->Arg(static_cast<int>(EffortLevel::kFewerIterations))
    ->Unit(benchmark::kMicrosecond);

/// All of a sequence, keyframes included; the map is not optimised, and making it is not timed.
void tracker_frame(benchmark::State& state) {
  const auto effort = static_cast<EffortLevel>(state.range(0));
  KeyframeProposal proposal;
  while (state.KeepRunningBatch(kFrames)) {
    state.PauseTiming();
    Tracker tracker(rig(), {});
    tracker.prepare(proposal);
    PlainMap map;
    GraphSnapshot snapshot = map.publish();
    for (const Frame& frame : frames()) {
      state.ResumeTiming();
      const TrackResult result = tracker.step(frame, snapshot, &proposal, effort);
      state.PauseTiming();
      if (result.proposed) map.insert(proposal);
      if (result.proposed) snapshot = map.publish();
    }
    state.ResumeTiming();
  }
  state.SetLabel(describe(effort));
}
BENCHMARK(tracker_frame)
    ->ArgName("effort level")
    ->DenseRange(0, kEffortLevels - 2)
    ->Unit(benchmark::kMillisecond);

}  // namespace
}  // namespace twofold
