// Figures 6.11 and 6.12: one camera twice around a loop; its scale drifts.
#include <tbb/parallel_for.h>

#include <cmath>
#include <memory>

#include "experiments/double_window/double_loop_methods.hpp"
#include "experiments/double_window/place_recognition.hpp"

namespace twofold::bench {
namespace {

constexpr int kInner = 30, kOuter = 100;
constexpr double kHuberSigmas = 3;  // as in the scale drift experiment: points are seen three or four times
constexpr std::size_t kLater = 20;  // keyframes after the closure at which the map is shown again

MapperOptions mapper_options(LoopMethod method, const DoubleWindowExperimentOptions& options) {
  MapperOptions mapper = simulation_mapper_options(options);
  mapper.solver.huber_sigmas = kHuberSigmas;
  mapper.inner_window = method == kLoopBa ? kUnbounded : kInner;
  mapper.outer_window = method == kLoopGlobal || method == kLoopGlobalRigid ? kUnbounded : kOuter;
  return mapper;
}

/// One method on one scene.
class Contestant {
 public:
  Contestant(const Scene& scene, LoopMethod method, const DoubleWindowExperimentOptions& options)
      : mapper_(scene.rig, mapper_options(method, options),
                method == kLoopRigid || method == kLoopGlobalRigid ? LoopGroup::kSe3 : LoopGroup::kSim3),
        feeder_(scene, Association::kLocal),
        places_(scene, feeder_),
        scene_(scene) {}
  Contestant(const Contestant&) = delete;  // places_ refers to feeder_
  Contestant& operator=(const Contestant&) = delete;

  void map_next() {
    Round& round = trial_.rounds.emplace_back();
    const KeyframeProposal& proposal = feeder_.propose(mapper_.graph());
    const double start = thread_cpu_ms();
    const MapperReport report = mapper_.step(proposal);
    record_cost(report, thread_cpu_ms() - start, round);
  }

  /// Looks for a place seen before, and closes the loop: a part of the same keyframe's round.
  void close_loop() {
    const std::size_t k = trial_.rounds.size() - 1;
    const Recognition seen = places_.look(mapper_.graph());
    if (seen.found()) {
      if (trial_.loops.empty()) take_shot("before the loop closes");
      trial_.loops.push_back({k, index(seen.loop.to), seen.loop.S_to_from.scale()});
      const double start = thread_cpu_ms();
      const MapperReport report = mapper_.close(seen.loop, seen.copies);
      record_cost(report, trial_.rounds.back().cpu_ms + thread_cpu_ms() - start, trial_.rounds.back());
    }
    if (!trial_.loops.empty() && k == trial_.loops.front().keyframe + kLater) take_shot("closed");
    if (k + 1 == static_cast<std::size_t>(scene_.keyframes())) take_shot("second round");
  }

  void record(const DoubleWindow& window) {
    record_errors(mapper_.graph(), 1, scene_, window, trial_.rounds.back());
    record_scale(mapper_.graph(), scene_, window, trial_.rounds.back());
  }

  [[nodiscard]] const DoubleWindow& window() const { return mapper_.window(); }
  [[nodiscard]] LoopTrial take() { return std::move(trial_); }

 private:
  void take_shot(const std::string& when) {
    const auto shown = [this](KeyframeId id) { return mapper_.window().contains(id); };
    trial_.shots.push_back({when + ", keyframe " + std::to_string(trial_.rounds.size()),
                            aligned_centres(mapper_.graph(), scene_),
                            log_scales(mapper_.graph(), scene_, shown)});
  }

  DriftMapper mapper_;
  Feeder feeder_;
  PlaceRecognition places_;
  const Scene& scene_;
  LoopTrial trial_;
};

/// All methods side by side, so that their errors are taken over the same edges: those of cDWO's windows.
std::vector<LoopTrial> run_trial(const Scene& scene, const DoubleWindowExperimentOptions& options) {
  std::vector<std::unique_ptr<Contestant>> contestants;
  for (std::size_t m = 0; m < kLoopMethods; ++m) {
    contestants.push_back(std::make_unique<Contestant>(scene, static_cast<LoopMethod>(m), options));
  }
  for (int k = 0; k < scene.keyframes(); ++k) {
    for (auto& contestant : contestants) {
      contestant->map_next();
      contestant->close_loop();
    }
    for (auto& contestant : contestants) contestant->record(contestants[kLoopConstant]->window());
  }
  std::vector<LoopTrial> trials;
  for (auto& contestant : contestants) trials.push_back(contestant->take());
  return trials;
}

/// The trial to be shown: that of the largest drift.
std::size_t most_drift(const LoopTrials& methods) {
  std::size_t most = 0;
  double drift = -1;
  for (std::size_t t = 0; t < methods[kLoopConstant].size(); ++t) {
    const LoopTrial& trial = methods[kLoopConstant][t];
    if (trial.loops.empty() || std::abs(std::log(trial.loops.front().scale)) <= drift) continue;
    drift = std::abs(std::log(trial.loops.front().scale));
    most = t;
  }
  return most;
}

}  // namespace

void double_loop_experiment(const DoubleWindowExperimentOptions& options, Report& report) {
  const auto scene = [&](std::size_t trial) {
    return double_loop_scene(options.scene, options.loop_keyframes,
                             options.seed + static_cast<unsigned>(trial));
  };
  const auto count = static_cast<std::size_t>(options.trials);
  LoopTrials methods(kLoopMethods, std::vector<LoopTrial>(count));
  tbb::parallel_for(std::size_t{0}, count, [&](std::size_t trial) {
    std::vector<LoopTrial> results = run_trial(scene(trial), options);
    for (std::size_t m = 0; m < kLoopMethods; ++m) methods[m][trial] = std::move(results[m]);
  });
  std::vector<MethodRounds> rounds;
  for (std::size_t m = 0; m < kLoopMethods; ++m) {
    rounds.push_back({kLoopNames[m], {}});
    for (const LoopTrial& trial : methods[m]) rounds[m].trials.push_back(trial.rounds);
  }
  write_rounds("double_loop", "double loop", rounds, true, report);
  const std::size_t shown = most_drift(methods);
  write_png(report.file("double_loop_paths.png"), draw_loop_paths(methods, shown, scene(shown)));
  write_png(report.file("double_loop_scales.png"), draw_loop_scales(methods, shown));
  state_double_loop(methods, options.seed, report);
}

}  // namespace twofold::bench
