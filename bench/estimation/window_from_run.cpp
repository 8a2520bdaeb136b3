// bench/window_from_run SOURCE FILE: a problem the mapper solves in a run, for bench/window. It is a program
// of its own because an engine and Ceres in one program fail: memory is allocated one way and freed another.
#include <CLI/CLI.hpp>
#include <atomic>
#include <cstdio>
#include <exception>
#include <fstream>
#include <memory>
#include <stdexcept>

#include "engine/engine.hpp"
#include "fixtures/files/window_problem_io.hpp"
#include "io/sources/open_source.hpp"
#include "loopclosure/default_vocabulary.hpp"
#include "mapping/mapper_hook.hpp"

namespace twofold {
namespace {

/// Which problem to take out of which run.
struct RunOptions {
  std::string source;  ///< of frames, as `twofold run` takes it
  int inner = 25;      ///< windows of the mapper
  int outer = 175;
  int round = 0;  ///< of the mapper, from 1; 0: the last of those with the most poses
};

struct RunProblem {
  WindowProblem problem;
  int round = 0;   ///< it was taken from
  int rounds = 0;  ///< the mapper made in all
};

/// Keeps the problem of the round that is wanted.
class ProblemTaker : public MapperHook {
 public:
  /// `taken` must outlive this.
  ProblemTaker(int round, RunProblem& taken) : round_(round), taken_(taken) {}

  void before_solve(const DoubleWindow&, WindowProblem& problem) override {
    ++taken_.rounds;
    const bool wanted =
        round_ > 0 ? taken_.rounds == round_ : problem.poses.size() >= taken_.problem.poses.size();
    if (!wanted) return;
    taken_.problem = problem;
    taken_.round = taken_.rounds;
  }

 private:
  int round_;
  RunProblem& taken_;
};

/// Runs the engine over the source, one thread and one order, and takes the problem one of the mapper's
/// rounds starts its joint optimisation from: the newest keyframe is where the tracker put it. Throws
/// std::runtime_error when the source cannot be opened or read, or there was no such round.
RunProblem window_from_run(const RunOptions& options) {
  const std::unique_ptr<FrameSource> source = open_source(options.source);
  RunProblem taken;
  EngineOptions engine_options;
  engine_options.deterministic = true;
  engine_options.vocabulary = std::make_shared<const Vocabulary>(load_default_vocabulary());
  engine_options.mapper.inner_window = options.inner;
  engine_options.mapper.outer_window = options.outer;
  engine_options.mapper.hook = std::make_shared<ProblemTaker>(options.round, taken);
  const FrameFeed feed = [&](Frame& frame) { return source->next(frame); };
  const std::atomic<bool> interrupted{false};
  const RunResult result = Engine(source->rig(), engine_options).run(feed, interrupted);
  if (!source->error().empty()) throw std::runtime_error(source->error());
  if (!result.error.empty()) throw std::runtime_error(options.source + ": " + result.error);
  if (taken.round == 0) {
    throw std::runtime_error(options.source + ": the mapper made " + std::to_string(taken.rounds) +
                             " rounds, none of them the one asked for");
  }
  return taken;
}

void write(const std::string& file, const WindowProblem& problem) {
  std::ofstream out(file);
  write_window_problem(out, problem);
  out.flush();
  if (!out) throw std::runtime_error(file + ": cannot be written");
}

}  // namespace
}  // namespace twofold

int main(int argc, char** argv) {
  twofold::RunOptions options;
  std::string file;
  CLI::App app("A double-window problem out of a run of the engine");
  app.option_defaults()->always_capture_default();
  app.add_option("SOURCE", options.source, "Source of frames, as `twofold run` takes it")->required();
  app.add_option("FILE", file, "Where the problem goes")->required();
  app.add_option("--inner", options.inner, "Keyframes of the inner window")->check(CLI::PositiveNumber);
  app.add_option("--outer", options.outer, "Keyframes of the outer window")->check(CLI::NonNegativeNumber);
  app.add_option("--round", options.round, "Round of the mapper, from 1; 0: the last with the most poses")
      ->check(CLI::NonNegativeNumber);
  CLI11_PARSE(app, argc, argv);
  try {
    const twofold::RunProblem taken = twofold::window_from_run(options);
    twofold::write(file, taken.problem);
    std::printf("round %d of %d: %zu poses, %zu points, %zu observations, %zu pose-pose constraints\n",
                taken.round, taken.rounds, taken.problem.poses.size(), taken.problem.points.size(),
                taken.problem.observations.size(), taken.problem.constraints.size());
  } catch (const std::exception& error) {
    std::fprintf(stderr, "window_from_run: %s\n", error.what());
    return 2;
  }
}
