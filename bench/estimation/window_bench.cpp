// Micro benchmarks of the estimation room on generated problems of the usual size.
#include <benchmark/benchmark.h>

#include "bench/estimation/typical_window.hpp"
#include "estimation/motion_only.hpp"
#include "estimation/point_elimination.hpp"
#include "estimation/window_solver.hpp"
#include "estimation/window_state.hpp"

namespace twofold {
namespace {

SyntheticWindow typical_window(bool outer_observations) {
  SyntheticWindowOptions options = typical_window_options();
  options.points_per_keyframe = outer_observations ? 70 : 80;
  options.outer_observations = outer_observations;
  return make_synthetic_window(options);
}

void counters(benchmark::State& state, const WindowProblem& problem) {
  state.counters["points"] = static_cast<double>(problem.points.size());
  state.counters["observations"] = static_cast<double>(problem.observations.size());
  state.counters["constraints"] = static_cast<double>(problem.constraints.size());
}

void BM_WindowSolve(benchmark::State& state) {
  const SyntheticWindow window = typical_window(state.range(0) != 0);
  WindowSolver solver;
  WindowSolverOptions options;
  options.relative_decrease = 0;
  SolverSummary summary;
  for (auto _ : state) {
    WindowProblem problem = window.start;
    summary = solver.solve(problem, options);
    benchmark::DoNotOptimize(problem.poses.data());
  }
  counters(state, window.start);
  state.counters["iterations"] = summary.iterations;
  state.counters["accepted"] = summary.accepted_steps;
}
BENCHMARK(BM_WindowSolve)->ArgName("outer_observations")->Arg(0)->Arg(1)->Unit(benchmark::kMillisecond);

/// The stages of one iteration.
struct Stages {
  SyntheticWindow window;
  WindowLayout layout;
  BlockCholesky system;
  PointElimination elimination;
  WindowState values;
  std::vector<Vector6> gradient, diagonal;

  explicit Stages(bool outer_observations) : window(typical_window(outer_observations)) {
    layout.build(window.start, system);
    for (const auto& pose : window.start.poses) values.poses.push_back(pose.T_k_w);
    for (const auto& track : layout.tracks()) values.psi.push_back(window.start.points[track.point].psi);
    values.relate(window.start, layout);
    gradient.resize(system.size());
    diagonal.resize(system.size());
  }
  void eliminate() {
    system.set_zero();
    elimination.eliminate(layout, ObservationModel(window.start.rig), HuberKernel{2}, values.relative,
                          values.psi, 1e-4, system, gradient, diagonal);
    for (int p = 0; p < system.size(); ++p) system.block(system.diagonal_index(p)).diagonal().array() += 1e3;
  }
};

void BM_StageLayout(benchmark::State& state) {
  Stages stages(state.range(0) != 0);
  for (auto _ : state) stages.layout.build(stages.window.start, stages.system);
}
BENCHMARK(BM_StageLayout)->ArgName("outer_observations")->Arg(0)->Arg(1)->Unit(benchmark::kMicrosecond);

void BM_StageOrderAndFill(benchmark::State& state) {
  Stages stages(state.range(0) != 0);
  for (auto _ : state) {
    BlockCholesky fresh;
    stages.layout.build(stages.window.start, fresh);
  }
}
BENCHMARK(BM_StageOrderAndFill)->ArgName("outer_observations")->Arg(0)->Arg(1)->Unit(benchmark::kMicrosecond);

void BM_StageEliminatePoints(benchmark::State& state) {
  Stages stages(state.range(0) != 0);
  for (auto _ : state) stages.eliminate();
  counters(state, stages.window.start);
}
BENCHMARK(BM_StageEliminatePoints)
    ->ArgName("outer_observations")
    ->Arg(0)
    ->Arg(1)
    ->Unit(benchmark::kMicrosecond);

void BM_StageEliminateAndFactorise(benchmark::State& state) {
  Stages stages(state.range(0) != 0);
  for (auto _ : state) {
    stages.eliminate();
    if (!stages.system.factorise()) state.SkipWithError("not positive definite");
  }
}
BENCHMARK(BM_StageEliminateAndFactorise)
    ->ArgName("outer_observations")
    ->Arg(0)
    ->Arg(1)
    ->Unit(benchmark::kMicrosecond);

void BM_StageCost(benchmark::State& state) {
  Stages stages(state.range(0) != 0);
  const auto before = stages.values.psi;
  for (auto _ : state) {
    benchmark::DoNotOptimize(
        window_state_cost(stages.window.start, stages.layout, {}, before, stages.values));
  }
}
BENCHMARK(BM_StageCost)->ArgName("outer_observations")->Arg(0)->Arg(1)->Unit(benchmark::kMicrosecond);

void BM_StructureOnly(benchmark::State& state) {
  const SyntheticWindow window = typical_window(true);
  for (auto _ : state) {
    WindowProblem problem = window.start;
    optimise_structure(problem, {});
    benchmark::DoNotOptimize(problem.points.data());
  }
}
BENCHMARK(BM_StructureOnly)->Unit(benchmark::kMillisecond);

/// Two rounds from 10 cm and 2 degrees off, a tenth of the matches wrong.
void BM_MotionOnly(benchmark::State& state) {
  std::mt19937 rng(3);
  std::uniform_real_distribution<double> uniform(-1, 1);
  std::normal_distribution<double> normal;
  Rig rig = synthetic_window_detail::make_rig(SensorKind::kStereo);
  rig.noise.sigma_px = 1;
  Vector6 motion;
  motion << 0.05, -0.05, 0.1, 0.02, -0.03, 0.01;
  const SE3 T_c_ref = SE3::exp(motion);
  std::vector<MotionObservation> observations;
  for (int n = 0; n < state.range(0); ++n) {
    const Vector3 x_ref(2 * uniform(rng), 1.5 * uniform(rng), 5 + 2 * uniform(rng));
    StereoPixel z = rig.project(T_c_ref * x_ref) + 0.7 * Vector3(normal(rng), normal(rng), normal(rng));
    if (n % 10 == 0) z += Vector3(20, -15, 20);
    if (n % 4 == 0) z.z() = Rig::kNoRight;
    observations.push_back(observe_point(rig, x_ref, z.cast<float>(), 0));
  }
  MotionOnlyOptions options;
  options.stop_step = state.range(1) != 0 ? options.stop_step : 0;
  MotionOnlyResult result;
  for (auto _ : state) {
    result = optimise_motion(rig, observations, SE3(), options);
    benchmark::DoNotOptimize(result);
  }
  state.counters["inliers"] = result.inliers;
}
BENCHMARK(BM_MotionOnly)
    ->ArgNames({"observations", "early_stop"})
    ->Args({200, 1})
    ->Args({200, 0})
    ->Args({1000, 1})
    ->Unit(benchmark::kMicrosecond);

}  // namespace
}  // namespace twofold
