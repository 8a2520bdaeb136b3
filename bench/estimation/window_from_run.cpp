#include "bench/estimation/window_from_run.hpp"

#include <atomic>
#include <memory>
#include <stdexcept>

#include "engine/engine.hpp"
#include "io/open_source.hpp"
#include "loopclosure/default_vocabulary.hpp"

namespace twofold {

RunProblem window_from_run(const RunOptions& options) {
  const std::unique_ptr<FrameSource> source = open_source(options.source);
  RunProblem taken;
  EngineOptions engine_options;
  engine_options.deterministic = true;
  engine_options.vocabulary = std::make_shared<const Vocabulary>(load_default_vocabulary());
  engine_options.mapper.inner_window = options.inner;
  engine_options.mapper.outer_window = options.outer;
  engine_options.mapper.watch_problem = [&](const WindowProblem& problem) {
    ++taken.rounds;
    const bool wanted = options.round > 0 ? taken.rounds == options.round
                                          : problem.poses.size() >= taken.problem.poses.size();
    if (!wanted) return;
    taken.problem = problem;
    taken.round = taken.rounds;
  };
  const FrameFeed feed = [&](Frame& frame) {
    const FrameStatus status = source->next(frame);
    if (status == FrameStatus::kFrame) return FeedStatus::kFrame;
    return status == FrameStatus::kEnd ? FeedStatus::kEnd : FeedStatus::kError;
  };
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

}  // namespace twofold
